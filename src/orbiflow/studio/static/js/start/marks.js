/** What people paint over a picture: strokes on layers, as masks to send. */

/**
 * Draw a stroke, whose shape is "brush" or "lasso", in a colour.
 *
 * @param {CanvasRenderingContext2D} context
 * @param {{ shape: string, size: number, points: Point[], erases?: boolean }} stroke
 * @param {string} colour
 */
export function drawStroke(context, { shape, size, points, erases }, colour) {
  context.save();
  context.globalCompositeOperation = erases ? "destination-out" : "source-over";
  Object.assign(context, {
    strokeStyle: colour,
    fillStyle: colour,
    lineWidth: size,
    lineCap: "round",
    lineJoin: "round",
  });
  context.beginPath();
  points.forEach(([x, y]) => context.lineTo(x, y));
  if (shape === "lasso") {
    context.closePath();
    context.fill();
  } else {
    if (points.length === 1) context.lineTo(points[0][0] + 0.01, points[0][1]);
    context.stroke();
  }
  context.restore();
}

/** Layers of strokes of width by height pixels, each over the picture that it began with, if any. */
export class Marks {
  constructor(width, height) {
    this.width = width;
    this.height = height;
    this.strokes = [];
    this.before = {};
  }

  add(stroke) {
    this.strokes = [...this.strokes, stroke];
  }

  /** Forget all strokes, and what the layers began with. */
  clear() {
    this.strokes = [];
    this.before = {};
  }

  /** The strokes that touch a layer. */
  of(layer, strokes = this.strokes) {
    return strokes.filter((stroke) => stroke.layer === layer || stroke.erases);
  }

  /** Begin a layer with a mask that the server has: white counts, black does too if `both`. */
  async load(layer, url, { both = false } = {}) {
    const image = new Image();
    image.src = url;
    await image.decode();
    const canvas = this.canvas();
    const context = canvas.getContext("2d", { willReadFrequently: true });
    context.drawImage(image, 0, 0, this.width, this.height);
    if (!both) {
      const pixels = context.getImageData(0, 0, this.width, this.height);
      for (let k = 0; k < pixels.data.length; k += 4) {
        pixels.data[k + 3] = Math.min(pixels.data[k], pixels.data[k + 3]);
        pixels.data.fill(255, k, k + 3);
      }
      context.putImageData(pixels, 0, 0);
    }
    this.before[layer] = canvas;
  }

  canvas() {
    return Object.assign(document.createElement("canvas"), {
      width: this.width,
      height: this.height,
    });
  }

  /** A layer as a canvas; `colour(stroke)`: that of each stroke. */
  layer(layer, colour) {
    const canvas = this.canvas();
    const context = canvas.getContext("2d");
    if (this.before[layer]) context.drawImage(this.before[layer], 0, 0);
    for (const stroke of this.of(layer)) drawStroke(context, stroke, colour(stroke));
    return canvas;
  }

  /** Whether a layer has anything to send. */
  has(layer) {
    return Boolean(this.before[layer]) || this.strokes.some((stroke) => stroke.layer === layer);
  }

  /** A layer as a PNG: white and black, over black unless `clear`. */
  png(layer, { clear = false } = {}) {
    const painted = this.layer(layer, (stroke) => (stroke.black ? "#000" : "#fff"));
    if (!clear) {
      const context = painted.getContext("2d");
      context.globalCompositeOperation = "destination-over";
      context.fillRect(0, 0, this.width, this.height);
    }
    return new Promise((resolve) => {
      painted.toBlob(resolve, "image/png");
    });
  }
}
