// Where a rule lays copies: places in the cell, in its pattern, and on the canvas, whose cells are 256 wide.
export const UNIT = 256;
const TALL = Math.sqrt(0.75);
const whole = value => value - Math.floor(value);

export class Lattice {
  constructor({ repeat, hexagonal, operations, shift, size }) {
    Object.assign(this, { repeat, hexagonal, operations, shift, aspect: size[0] / size[1] });
    this.turns = hexagonal ? [[0, 0]] : null;
  }

  // From the pattern, in cells, to the canvas and back.
  toCanvas([u, v]) {
    return this.hexagonal ? { x: (u - v / 2) * UNIT, y: v * TALL * UNIT } : { x: u * UNIT, y: v * this.aspect * UNIT };
  }

  fromCanvas({ x, y }) {
    if (!this.hexagonal) return [x / UNIT, y / UNIT / this.aspect];
    const v = y / UNIT / TALL;
    return [x / UNIT + v / 2, v];
  }

  // From a place in the cell to its copy in a row and column, and back.
  copy([u, v], row, column) {
    const odd = value => Math.abs(value % 2) === 1;
    if (this.repeat === 'reflect') return [column + (odd(column) ? 1 - u : u), row + (odd(row) ? 1 - v : v)];
    if (this.repeat === 'rotate' && odd(row + column)) return [column + 1 - u, row + 1 - v];
    if (this.shift?.[0] === 1) return [column + whole(u + row * this.shift[1]), row + v];
    if (this.shift) return [column + u, row + whole(v + column * this.shift[1])];
    return [column + u, row + v];
  }

  inCell([U, V]) {
    const column = Math.floor(U), row = Math.floor(V), u = U - column, v = V - row;
    if (this.repeat === 'none') return [Math.min(1, Math.max(0, U)), Math.min(1, Math.max(0, V))];
    if (this.shift?.[0] === 1) return [whole(u - row * this.shift[1]), v];
    if (this.shift) return [u, whole(v - column * this.shift[1])];
    const [x, y] = this.copy([u, v], row, column);
    return [x - column, y - row]; // mirrors and half turns undo themselves
  }

  apply([[a, b], [c, d], [t, s]], [x, y]) { return [whole(a * x + b * y + t / 2), whole(c * x + d * y + s / 2)]; }

  undo([[a, b], [c, d], [t, s]], [x, y]) {
    const det = a * d - b * c, p = x - t / 2, q = y - s / 2;
    return [whole((d * p - b * q) / det), whole((a * q - c * p) / det)];
  }

  // Rows and columns of the cells that a part of the canvas shows.
  *cells(from, to) {
    if (this.repeat === 'none') { yield [0, 0]; return; }
    const corners = [[from.x, from.y], [to.x, from.y], [from.x, to.y], [to.x, to.y]].map(([x, y]) => this.fromCanvas({ x, y }));
    const along = axis => [Math.floor(Math.min(...corners.map(one => one[axis]))), Math.floor(Math.max(...corners.map(one => one[axis])))];
    const [left, right] = along(0), [top, bottom] = along(1);
    for (let row = top; row <= bottom; row++) for (let column = left; column <= right; column++) yield [row, column];
  }

  corners(row, column) {
    return [[0, 0], [1, 0], [1, 1], [0, 1]].map(([u, v]) => this.toCanvas([column + u, row + v]));
  }
}
