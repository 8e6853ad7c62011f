/** Sparse matrices, row by row in typed arrays. No page is needed here. */

/** @typedef {{ start: Int32Array, at: Int32Array, value: Float64Array, cols: number }} Sparse */

/**
 * Rows of a sparse matrix as typed arrays, from {indptr, indices, values}.
 *
 * @param {{ indptr: ArrayLike<number>, indices: ArrayLike<number>, values: ArrayLike<number> }} rows
 * @param {number} cols
 */
export function sparse({ indptr, indices, values }, cols) {
  return {
    start: Int32Array.from(indptr),
    at: Int32Array.from(indices),
    value: Float64Array.from(values),
    cols,
  };
}

/**
 * The same from rows that map a column to its value.
 *
 * @param {Map<number, number>[]} rows
 * @param {number} cols
 */
export function sparseOf(rows, cols) {
  const indptr = [0];
  rows.forEach((row) => indptr.push(indptr.at(-1) + row.size));
  const indices = rows.flatMap((row) => [...row.keys()]);
  const values = rows.flatMap((row) => [...row.values()]);
  return sparse({ indptr, indices, values }, cols);
}

/**
 * out = matrix x, as many rows as fit
 *
 * @param {Sparse} matrix
 * @param {Float64Array} x
 * @param {Float64Array} out
 */
export function multiply(matrix, x, out) {
  const { start, at, value } = matrix;
  for (let i = 0; i < out.length; i += 1) {
    let sum = 0;
    for (let k = start[i]; k < start[i + 1]; k += 1) sum += value[k] * x[at[k]];
    out[i] = sum;
  }
  return out;
}

/**
 * out = transposed matrix x
 *
 * @param {Sparse} matrix
 * @param {Float64Array} x
 * @param {Float64Array} out
 */
export function multiplyBack(matrix, x, out) {
  const { start, at, value } = matrix;
  out.fill(0);
  for (let i = 0; i < start.length - 1; i += 1) {
    const own = x[i];
    if (own !== 0) {
      for (let k = start[i]; k < start[i + 1]; k += 1) out[at[k]] += value[k] * own;
    }
  }
  return out;
}

/** @param {Float64Array} a @param {Float64Array} b */
export function dot(a, b) {
  let sum = 0;
  for (let i = 0; i < a.length; i += 1) sum += a[i] * b[i];
  return sum;
}
