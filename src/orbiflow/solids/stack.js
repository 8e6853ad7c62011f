// A stack of solids, to be turned and taken apart: WebGL 2, nothing from another host. It comes after turned.js in one
// module.

const EYE = 5; // distance of the eye, in radii of what is seen
const GLIDE = 1400, ROUND = 24000; // milliseconds of opening a stack, and of a turn

const VERTEX = `#version 300 es
  precision highp float;
  uniform mat3 turn, view; uniform vec3 shift, center; uniform vec2 size; uniform float radius;
  in vec3 p, n; out vec3 normal; out float far;
  void main() {
    vec3 seen = view * (turn * p + shift - center) / radius;
    normal = view * (turn * n);
    far = seen.z;
    gl_Position = vec4(seen.xy * size, -0.4 * seen.z, 1.0 - seen.z / ${EYE.toFixed(1)});
  }`;

// the light of solid_pictures.py, seen by the same eye
const FRAGMENT = `#version 300 es
  precision highp float;
  uniform vec3 colour; in vec3 normal; in float far; out vec4 ink;
  void main() {
    vec3 n = normalize(normal);
    float key = max(dot(n, vec3(-0.501, 0.621, 0.601)), 0.0), fill = max(dot(n, vec3(0.827, 0.11, 0.551)), 0.0);
    float around = 0.18 * fill + 0.22 + 0.24 * (0.5 + 0.5 * n.y);
    float rim = smoothstep(0.0, 0.45, n.z), depth = 0.86 + 0.14 * smoothstep(-1.0, 0.6, far);
    vec3 light = 0.8 * key * vec3(1.0, 0.985, 0.95) + around * vec3(0.95, 0.98, 1.0);
    vec3 own = pow(colour, vec3(2.2)) * light * depth * mix(0.6, 1.0, rim);
    own += 0.1 * pow(max(dot(n, vec3(-0.28, 0.347, 0.895)), 0.0), 24.0);
    ink = vec4(pow(min(own, 1.0), vec3(1.0 / 2.2)), 1.0);
  }`;

/**
 * Draw solids on a canvas, to be turned by mouse, touch and keys; null where there is no WebGL 2.
 *
 * - `data`: What `stack_data` in web_page.py returns.
 * - `changed`: Called with the view whenever it has changed by itself or by a key.
 * - `scrolls`: Whether the page scrolls: then the wheel zooms only with the Ctrl key.
 */
export function showStack(canvas, data, { changed = () => {}, scrolls = false } = {}) {
  const gl = canvas.getContext("webgl2", { antialias: true });
  if (!gl) return null;
  const calm = matchMedia("(prefers-reduced-motion: reduce)");
  const view = { ...data.start, zoom: 1, apart: 0, shown: "stack", turning: false };
  let drawn = prepare();
  let glide = null, before = 0, reach = goal();

  function prepare() {
    const made = programOf(gl, VERTEX, FRAGMENT);
    const meshes = {};
    for (const [name, mesh] of Object.entries(data.meshes)) {
      const array = gl.createVertexArray(), indices = unpack(mesh.triangles, Uint32Array);
      gl.bindVertexArray(array);
      feed(gl, made, "p", stored(gl, unpack(mesh.points, Float32Array)), 3, gl.FLOAT);
      feed(gl, made, "n", stored(gl, unpack(mesh.normals, Int8Array)), 3, gl.BYTE, true);
      stored(gl, indices, gl.ELEMENT_ARRAY_BUFFER);
      gl.bindVertexArray(null);
      meshes[name] = { array, count: indices.length };
    }
    gl.enable(gl.DEPTH_TEST);
    const at = Object.fromEntries(["turn", "view", "shift", "center", "size", "radius", "colour"].map(name => [name, gl.getUniformLocation(made, name)]));
    return { made, meshes, at };
  }

  // rows to the right, up and towards the eye, in the coordinates of the solids
  function rows() {
    const [right, back, up] = data.axes;
    const along = (x, y, z) => [0, 1, 2].map(k => x * right[k] + y * back[k] + z * up[k]);
    const [cy, sy, cp, sp] = [Math.cos(view.yaw), Math.sin(view.yaw), Math.cos(view.pitch), Math.sin(view.pitch)];
    return [along(cy, sy, 0), along(-sp * sy, sp * cy, cp), along(cp * sy, -cp * cy, sp)];
  }
  // middle and radius of what is to be seen
  function goal() {
    const { center, radius, opened } = data.balls[view.shown];
    return { center, radius: radius + view.apart * (opened - radius) };
  }
  function draw() {
    const { made, meshes, at } = drawn, { width, height } = canvas, short = Math.min(width, height);
    const [right, up, eye] = rows(), size = 0.98 * view.zoom;
    gl.viewport(0, 0, width, height);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.useProgram(made);
    gl.uniformMatrix3fv(at.view, false, [0, 1, 2].flatMap(k => [right[k], up[k], eye[k]]));
    gl.uniform3fv(at.center, reach.center);
    gl.uniform2f(at.size, size * short / width, size * short / height);
    gl.uniform1f(at.radius, reach.radius);
    const stacked = view.shown === "stack";
    const mesh = meshes[stacked ? "tile" : view.shown];
    gl.bindVertexArray(mesh.array);
    for (const copy of stacked ? data.copies : [{ turn: [1, 0, 0, 0, 1, 0, 0, 0, 1], shift: [0, 0, 0], away: [0, 0, 0], colour: data.colours[view.shown] }]) {
      gl.uniformMatrix3fv(at.turn, false, copy.turn);
      gl.uniform3fv(at.shift, copy.shift.map((s, k) => s + view.apart * copy.away[k]));
      gl.uniform3fv(at.colour, copy.colour);
      gl.drawElements(gl.TRIANGLES, mesh.count, gl.UNSIGNED_INT, 0);
    }
  }
  const redraw = atNextFrame(paint);
  function paint(now) {
    const passed = before ? Math.min(now - before, 500) : 0;
    if (glide) {
      glide.done = Math.min(1, glide.done + passed / GLIDE);
      const eased = glide.done * glide.done * (3 - 2 * glide.done);
      view.apart = glide.from + (glide.to - glide.from) * eased;
      if (glide.done === 1) glide = null;
      changed(view);
    }
    if (view.turning) view.yaw += 2 * Math.PI * passed / ROUND;
    sized(canvas);
    reach = goal();
    draw();
    const moves = glide || view.turning;
    before = moves ? now : 0;
    if (moves) redraw();
  }

  function moveApart(share) {
    view.shown = "stack";
    glide = null;
    view.apart = Math.max(0, Math.min(1, share));
    changed(view);
    redraw();
  }
  function glideApart(share) {
    if (calm.matches) return moveApart(share);
    view.shown = "stack";
    glide = { from: view.apart, to: share, done: 0 };
    redraw();
  }
  function keepTurning(on) { view.turning = on; changed(view); redraw(); }
  function show(name) { view.shown = name; redraw(); }
  function startAgain() {
    Object.assign(view, data.start, { zoom: 1, turning: false });
    moveApart(0);
  }

  byHand(canvas, byAngles(canvas, view, redraw), {
    scrolls,
    keys: { "[": () => moveApart(view.apart - 0.1), "]": () => moveApart(view.apart + 0.1), 0: startAgain },
  });
  canvas.addEventListener("webglcontextlost", e => e.preventDefault());
  canvas.addEventListener("webglcontextrestored", () => { drawn = prepare(); redraw(); });
  new ResizeObserver(() => redraw()).observe(canvas);
  changed(view);
  return { view, show, moveApart, glideApart, keepTurning, startAgain };
}
