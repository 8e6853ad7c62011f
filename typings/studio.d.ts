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
}

interface Group {
  name?: string;
  lattice: [Point, Point];
  cosets: { linear: [Point, Point]; translation: Point }[];
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
  polygon: Point[];
  y_down: boolean;
  neck: [Point, Point];
  group: Group;
  colours: { sublattice: [number, number, number]; table: number[][][] };
}

/** What is drawn of a tile. */
type Outlined = Pick<Card, "polygon" | "y_down" | "group" | "colours">;

/** A copy of a tile in view; its matrix leads from the prototile to the canvas. */
interface Copy {
  aspect: number;
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

/** A tile on a page of its own: see tile_view in tile_view.py. */
interface TileView extends Card {
  elements: Elements;
  silhouette_track: Point[];
  tile_track: Point[];
  map: TileMap | null;
  covered: [Point, Point] | null;
}

interface Task {
  id: number;
  operation: string;
  state: "waiting" | "running" | "paused" | "done" | "failed" | "cancelled";
  share: number;
  what: string;
  error: string | null;
  place: number;
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
  search?: { effort: string; objective: string; palette: string };
  closeup?: any;
  drawing?: any;
}

interface Project {
  id: string;
  name: string;
  kind: "tile" | "density";
  head?: number;
  input: { name: string; type: string } | null;
  reading: Reading;
  silhouette: Silhouette | null;
  tasks: Task[];
  tiles: Card[];
  view: Views | null;
  mend: string | null;
  pins: string | null;
  emphasis: string | null;
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
  tileId: number | null;
  navigate: typeof import("../src/orbiflow/studio/static/js/main.js").navigate;
  about: About;
}
