// A surface coloured by a density, to be turned, by WebGL 2.
// It comes after turned.js in one module.

const PULL = 0.006; // how far lines and dots are pulled forward
const PALENESS = 0.85; // how grey is what lies outside a region

/**
 * Draw a surface on a canvas, to be turned by mouse, touch and keys; labels are put beside the canvas. Null where there
 * is no WebGL 2.
 *
 * - `data`: What `surface_data` in surfaces.py returns.
 * - `changed`: Called with the view when a key sets it back.
 * - `scrolls`: Whether the page scrolls: then the wheel zooms only with the Ctrl key.
 *
 * Returns `view`, whose `cut` (0 to 100), `dots`, `least` (levels from 0 to 1: what is below is greyed) and `pale`
 * (that grey, 0 to 1) may be changed before a `redraw()`, and `stop()`.
 */
export function showSurface(canvas, data, { changed = () => {}, scrolls = false } = {}) {
  const gl = canvas.getContext("webgl2");
  if (!gl) return null;
  const view = { ...data.start, zoom: 1, dots: data.dots && data.samples !== "", least: -1, pale: 0.8 };
  const points = unpack(data.points, Float32Array), normals = unpack(data.normals, Int8Array);
  const values = unpack(data.values, Uint16Array), triangles = unpack(data.triangles, Uint16Array);
  const colours = unpack(data.colours, Uint8Array), samples = unpack(data.samples, Float32Array);
  const widths = unpack(data.widths, Float32Array);
  const levels = data.levels ? unpack(data.levels, Uint16Array) : values;
  const lines = data.lines.map(({ width, points, counts }) => {
    const p = unpack(points, Float32Array), segments = [];
    let first = 0;
    for (const count of counts) {
      for (let i = first; i < first + count - 1; i++)
        segments.push(...p.subarray(3 * i, 3 * i + 6));
      first += count;
    }
    return { width, segments: new Float32Array(segments) };
  });

  // unit vectors to the right, up and towards the eye
  function frame() {
    const [cy, sy, cp, sp] = [Math.cos(view.yaw), Math.sin(view.yaw), Math.cos(view.pitch), Math.sin(view.pitch)];
    return { right: [-sy, cy, 0], up: [-sp * cy, -sp * sy, cp], eye: [cp * cy, cp * sy, sp] };
  }
  // column-major matrix from the surface's coordinates to clip space
  function matrix(width, height) {
    const { right, up, eye } = frame(), c = data.center, r = data.radius;
    const size = 0.88 * view.zoom * Math.sqrt(1 - 1 / data.eye ** 2), short = Math.min(width, height);
    const rows = [
      [...right.map(t => t * size * short / width / r), 0],
      [...up.map(t => t * size * short / height / r), 0],
      [...eye.map(t => -0.4 * t / r), 0],
      [...eye.map(t => -t / data.eye / r), 1],
    ];
    for (const row of rows) row[3] -= dot(row, c);
    return Float32Array.from([0, 1, 2, 3].flatMap(column => rows.map(row => row[column])));
  }
  // pixels across of the largest and the smallest dot, and of a unit of length in the middle
  function dotSizes(width, height, scale) {
    const size = 0.88 * view.zoom * Math.sqrt(1 - 1 / data.eye ** 2), short = Math.min(width, height);
    return { most: 5.5 * scale * Math.sqrt(view.zoom), least: 1.5 * scale, unit: size * short / 2 / data.radius };
  }
  // depth of the cutting plane, towards the eye; nothing is cut at 1
  const cutDepth = () => data.round || view.cut === 0 ? 9 : 1 - 2 * view.cut / 100;

  function drawer() {
    const head = `#version 300 es
      precision highp float;
      uniform mat4 M; uniform vec3 eye, center; uniform float radius, cut, lowest, pale;`;
    const depth = "depth = dot(eye, p - center) / radius;";
    const surface = programOf(gl, `${head}
      in vec3 p, n; in float t, l; out vec3 normal; out float value, level, depth;
      void main() { gl_Position = M * vec4(p, 1.0); normal = n; value = t; level = l; ${depth} }`, `${head}
      uniform sampler2D map; uniform vec3 right, up; in vec3 normal; in float value, level, depth; out vec4 colour;
      void main() {
        if (depth > cut) discard;
        vec3 m = normalize(normal); m *= sign(dot(m, eye) + 1e-9);
        float light = 0.7 + 0.3 * max(dot(m, normalize(eye + 0.5 * up - 0.4 * right)), 0.0);
        vec3 own = texture(map, vec2((value * 255.0 + 0.5) / 256.0, 0.5)).rgb;
        colour = vec4(light * (level < lowest ? mix(own, vec3(pale), ${PALENESS}) : own), 1.0);
      }`);
    const stroke = programOf(gl, `${head}
      in vec3 a, b; in vec2 corner; uniform vec2 size; uniform float width; out float depth;
      void main() {
        vec4 A = M * vec4(a, 1.0), B = M * vec4(b, 1.0);
        vec2 along = normalize((B.xy / B.w - A.xy / A.w) * size + 1e-9), side = vec2(-along.y, along.x);
        gl_Position = corner.x < 0.5 ? A : B;
        gl_Position.xy += (corner.y * side + (corner.x - 0.5) * along) * width / size * gl_Position.w;
        gl_Position.z -= ${PULL} * gl_Position.w;
        vec3 p = corner.x < 0.5 ? a : b; ${depth}
      }`, `${head}
      uniform vec4 ink; in float depth; out vec4 colour;
      void main() { if (depth > cut) discard; colour = ink; }`);
    const dots = programOf(gl, `${head}
      in vec3 p; in float wide; uniform float most, least, unit; out float depth, ink;
      void main() { gl_Position = M * vec4(p, 1.0); gl_Position.z -= ${PULL} * gl_Position.w;
        float own = wide * unit / gl_Position.w; gl_PointSize = clamp(own, least, most);
        ink = clamp(own * own / gl_PointSize / gl_PointSize, 0.03, 1.0); ${depth} }`, `${head}
      in float depth, ink; out vec4 colour;
      void main() {
        float r = 2.0 * length(gl_PointCoord - 0.5);
        if (r > 1.0 || depth > cut) discard;
        colour = r > 0.68 ? vec4(0.1, 0.1, 0.1, 0.8 * ink) : vec4(1.0, 1.0, 1.0, 0.85 * ink);
      }`);

    function setup(fill) {
      const array = gl.createVertexArray();
      gl.bindVertexArray(array);
      fill();
      gl.bindVertexArray(null);
      return array;
    }
    const surfaceArray = setup(() => {
      feed(gl, surface, "p", stored(gl, points), 3, gl.FLOAT);
      feed(gl, surface, "n", stored(gl, normals), 3, gl.BYTE, true);
      feed(gl, surface, "t", stored(gl, values), 1, gl.UNSIGNED_SHORT, true);
      feed(gl, surface, "l", stored(gl, levels), 1, gl.UNSIGNED_SHORT, true);
      stored(gl, triangles, gl.ELEMENT_ARRAY_BUFFER);
    });
    const corners = stored(gl, new Float32Array([0, -1, 0, 1, 1, -1, 1, 1]));
    const strokes = lines.map(({ width, segments }) => {
      const buffer = stored(gl, segments);
      return { width, count: segments.length / 6, array: setup(() => {
        feed(gl, stroke, "corner", corners, 2, gl.FLOAT);
        feed(gl, stroke, "a", buffer, 3, gl.FLOAT, false, [24, 0, 1]);
        feed(gl, stroke, "b", buffer, 3, gl.FLOAT, false, [24, 12, 1]);
      }) };
    });
    const dotsArray = setup(() => {
      feed(gl, dots, "p", stored(gl, samples), 3, gl.FLOAT);
      feed(gl, dots, "wide", stored(gl, widths), 1, gl.FLOAT);
    });
    gl.bindTexture(gl.TEXTURE_2D, gl.createTexture());
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, 256, 1, 0, gl.RGBA, gl.UNSIGNED_BYTE, colours);
    for (const [name, value] of [["MIN_FILTER", gl.LINEAR], ["MAG_FILTER", gl.LINEAR], ["WRAP_S", gl.CLAMP_TO_EDGE]])
      gl.texParameteri(gl.TEXTURE_2D, gl["TEXTURE_" + name], value);
    gl.enable(gl.DEPTH_TEST);
    gl.depthFunc(gl.LEQUAL);
    gl.blendFuncSeparate(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA, gl.ONE, gl.ONE_MINUS_SRC_ALPHA);

    return function draw(width, height, scale) {
      const { right, up, eye } = frame();
      const use = (made, array) => {
        const at = name => gl.getUniformLocation(made, name);
        gl.useProgram(made);
        gl.bindVertexArray(array);
        gl.uniformMatrix4fv(at("M"), false, matrix(width, height));
        for (const [name, value] of [["eye", eye], ["center", data.center], ["right", right], ["up", up]])
          gl.uniform3fv(at(name), value);
        gl.uniform1f(at("radius"), data.radius);
        gl.uniform1f(at("cut"), cutDepth());
        gl.uniform1f(at("lowest"), view.least);
        gl.uniform1f(at("pale"), view.pale);
        return at;
      };
      gl.viewport(0, 0, width, height);
      gl.clearColor(0, 0, 0, 0);
      gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
      gl.disable(gl.BLEND);
      gl.depthMask(true);
      use(surface, surfaceArray);
      gl.drawElements(gl.TRIANGLES, triangles.length, gl.UNSIGNED_SHORT, 0);
      gl.enable(gl.BLEND);
      gl.depthMask(false);
      for (const { width: pixels, count, array } of strokes) {
        const at = use(stroke, array);
        gl.uniform2f(at("size"), width, height);
        gl.uniform1f(at("width"), pixels * scale);
        gl.uniform4fv(at("ink"), [1, 1, 1, pixels < 1.5 ? 0.45 : 0.9]);
        gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, count);
      }
      if (view.dots) {
        const at = use(dots, dotsArray);
        for (const [name, value] of Object.entries(dotSizes(width, height, scale))) gl.uniform1f(at(name), value);
        gl.drawArrays(gl.POINTS, 0, samples.length / 3);
      }
    };
  }

  const tags = data.labels.map(({ text }) => {
    const tag = document.createElement("div");
    tag.className = "label";
    tag.textContent = text;
    canvas.parentElement.append(tag);
    return tag;
  });
  function placeLabels(width, height) {
    const m = matrix(width, height), { eye } = frame();
    data.labels.forEach(({ at }, k) => {
      const row = i => m[i] * at[0] + m[4 + i] * at[1] + m[8 + i] * at[2] + m[12 + i], w = row(3);
      tags[k].style.left = `${50 * (1 + row(0) / w)}%`;
      tags[k].style.top = `${50 * (1 - row(1) / w)}%`;
      // of a sphere the eye sees what is above 1 / data.eye of its radius
      tags[k].style.visibility = data.eye * dot(at, eye) > 0.96 * Math.hypot(...at) ? "visible" : "hidden";
    });
  }

  const draw = drawer();
  const redraw = atNextFrame(paint);
  function paint() {
    const { ratio } = sized(canvas), { width, height } = canvas;
    draw(width, height, ratio);
    placeLabels(width, height);
  }
  byHand(canvas, byAngles(canvas, view, redraw), {
    scrolls,
    keys: { 0: () => { Object.assign(view, data.start, { zoom: 1 }); changed(view); redraw(); } },
  });
  // at once: a frame later the old picture would have been stretched to the new size
  const observer = new ResizeObserver(paint);
  observer.observe(canvas);
  return { view, redraw, stop: () => { observer.disconnect(); for (const tag of tags) tag.remove(); } };
}

/** Fill an element with the bar of a surface's colours and its ticks. */
export function showBar(bar, data) {
  const colours = unpack(data.colours, Uint8Array), stops = [];
  for (let k = 0; k < 256; k += 5) stops.push(`rgb(${colours.subarray(4 * k, 4 * k + 3)})`);
  bar.style.background = `linear-gradient(to top, ${stops})`;
  bar.replaceChildren(...data.ticks.map(({ at, text }) => {
    const tick = document.createElement("span");
    tick.style.bottom = `${100 * at}%`;
    tick.textContent = text;
    return tick;
  }));
}
