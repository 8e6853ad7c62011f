/** What the server tells the studio's pages, and what pages hand to each other. */

type Point = [number, number];

/** [a, b, c, d, e, f] of a canvas: x -> a x + c y + e, y -> b x + d y + f. */
type Matrix = [number, number, number, number, number, number];

/** What is put into an element; what is null, undefined or false is left out. */
type Child = Node | string | number | boolean | null | undefined | Child[];

interface Palette {
  name?: string;
  colours: string[];
  outline: string;
  paper?: string;
  /** The colours of each of two figures, if it has 1, 2, 3 ... of them. */
  shades?: string[][][];
}

interface Group {
  name?: string;
  lattice: [Point, Point];
  cosets: { linear: [Point, Point]; translation: Point }[];
  /** The figure of each aspect, if a tile has several. */
  figures?: number[];
}

/** A tile in a list: see tile_card in tile_view.py. */
interface Card {
  id: number;
  class_name: string;
  stage: "sketch" | "better" | "final" | "pulled";
  stars: number;
  word: string;
  score: number;
  arrangement: string;
  certified: boolean;
  parent: number | null;
  root?: number;
  found_for?: string[];
  /** A better one that it is nearly like. */
  like?: number;
  polygon: Point[];
  y_down: boolean;
  neck: [Point, Point];
  group: Group;
  colours: { sublattice: [number, number, number]; table: number[][][]; shares?: number[] };
  /** The figures that divide it, if it is not one. */
  figures?: { name: string; stars: number; polygon: Point[]; neck: [Point, Point] }[];
}

/** What is drawn of a tile. */
type Outlined = Pick<Card, "polygon" | "y_down" | "group" | "colours"> & {
  figures?: { polygon: Point[] }[];
};

/** A figure of a tile, ready to be drawn. */
interface Figure {
  polygon: Point[];
  path: Path2D;
  area: number;
  middle: { x: number; y: number };
  radius: number;
}

/** A copy of a figure of a tile in view; its matrix leads from the tile to the canvas. */
interface Copy {
  aspect: number;
  figure: number;
  cell: [number, number];
  colour: number;
  matrix: Matrix;
}

interface Line {
  at: Point;
  along: Point;
  shift: number;
}

interface Elements {
  cell: Point[];
  centres: { order: number; at: Point }[];
  mirrors: Line[];
  glides: Line[];
}

/** The map from the silhouette to its tile, affine on triangles. */
interface TileMap {
  rest: Point[];
  images: Point[];
  triangles: [number, number, number][];
}

/** What a page shows of a figure: see figure_view in tile_view.py. */
interface FigureView {
  polygon: Point[];
  silhouette_track: Point[];
  tile_track: Point[];
  map: TileMap | null;
  no_map?: string;
  covered: [Point, Point] | null;
  y_down: boolean;
  place?: Matrix;
}

/** A tile on a page of its own, with what is shown of it or of each of its figures. */
type TileView = Card & FigureView & { notes?: string[]; elements: Elements; figures?: FigureView[] };

interface Task {
  id: number;
  operation: string;
  state: "waiting" | "running" | "paused" | "done" | "failed" | "cancelled";
  share: number;
  what: string;
  error: string | null;
  place: number;
  /** Seconds that such a task took here before. */
  usual?: number;
  result: any;
}

interface Silhouette {
  outline: Point[];
  width: number;
  height: number;
  backdrop: string;
  doubts: string[];
  notes: string[];
  left_out?: Point[][];
  coloured?: boolean;
  clear?: boolean;
  told_apart?: boolean;
  mark?: string;
}

interface Drawing {
  strokes: { points: Point[]; colour: string; width: number }[];
  eyes: { at: Point; size: number }[];
}

interface Reading {
  threshold?: number;
  invert?: boolean;
  smooth?: number;
  thicken?: number;
}

/** What a project remembers of its pages. */
interface Views {
  fill?: any;
  search?: { effort: string; objective: string; palette?: string };
  closeup?: any;
  /** What of the look of tiles was chosen: see look.js. */
  look?: any;
  drawing?: any;
}

/** A picture, what was read of it, and what was painted over it. */
interface Picture {
  input: { name: string; type: string } | null;
  reading: Reading;
  silhouette: Silhouette | null;
  mend: string | null;
  pins: string | null;
  emphasis: string | null;
}

interface Project extends Picture {
  id: string;
  name: string;
  kind: "tile" | "density" | "solid";
  head?: number;
  second: Picture | null;
  tasks: Task[];
  /** Seconds that tasks took since the studio was started, by what they were. */
  took?: Record<string, number>;
  tiles: Card[];
  view: Views | null;
  changed_by?: string;
}

interface About {
  version: string;
  limits: { bytes: number; pixels: number; projects: number };
  animals: { name: string; title: string; picture: string }[];
  palettes: Palette[];
  efforts: string[];
}

type Api = typeof import("../src/orbiflow/studio/static/js/api.js").api;
type Feed = import("../src/orbiflow/studio/static/js/events.js").Feed;

/** What the shell gives a page. */
interface Page {
  api: Api;
  events: Feed;
  project: Project;
  /** Of the tile or picture that the address names. */
  number: number | null;
  navigate: typeof import("../src/orbiflow/studio/static/js/main.js").navigate;
  about: About;
  /** Ends when the page is left. */
  signal: AbortSignal;
}

/** Shows a page; what it returns is called when the page is left. */
type Show = (root: HTMLElement, page: Page) => Promise<void | (() => any)>;
