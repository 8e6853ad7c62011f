/** What the studio uses of `density/pictures/surface.js`, which the server serves beside its own pages. */

export interface SurfaceView {
  cut: number;
  dots: boolean;
  least: number;
  pale: number;
}

export interface Surface {
  view: SurfaceView;
  redraw(): void;
  stop(): void;
}

export function unpack<Kind>(text: string, kind: new (buffer: ArrayBufferLike) => Kind): Kind;

export function showSurface(
  canvas: HTMLCanvasElement,
  data: object,
  options?: { changed?: (view: SurfaceView) => void; scrolls?: boolean },
): Surface | null;
