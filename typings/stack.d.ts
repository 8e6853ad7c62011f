/** What the studio uses of `solids/stack.js`, which the server serves beside its own pages. */

export interface StackView {
  apart: number;
  shown: string;
  turning: boolean;
}

export interface Stack {
  view: StackView;
  show(name: string): void;
  moveApart(share: number): void;
  glideApart(share: number): void;
  keepTurning(on: boolean): void;
  startAgain(): void;
}

export function showStack(
  canvas: HTMLCanvasElement,
  data: object,
  options?: { changed?: (view: StackView) => void; scrolls?: boolean },
): Stack | null;
