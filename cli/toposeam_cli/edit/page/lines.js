// Seams as smooth lines, by how alike the pictures are along them.
export const CLASSES = [
  { from: 0.75, colour: '#2fbf71', dash: [] },
  { from: 0.5, colour: '#e3c34a', dash: [14, 5] },
  { from: 0.3, colour: '#f2913d', dash: [8, 5] },
  { from: 0, colour: '#f2495c', dash: [3, 5] },
];
const SQUARE = 16;

const classOf = value => value === 255 ? 0 : CLASSES.findIndex(one => value / 254 >= one.from);
export const colourOf = likeness => CLASSES.find(one => likeness >= one.from).colour;

// Returns one path a class, in px of the canvas.
export function seamPaths(labels, width, height, squares) {
  const links = new Map(), corner = width + 1;
  const link = (a, b) => {
    links.get(a)?.push(b) ?? links.set(a, [b]);
    links.get(b)?.push(a) ?? links.set(b, [a]);
  };
  for (let y = 0, p = 0; y < height; y++) {
    for (let x = 0; x < width; x++, p++) {
      const own = labels[p];
      if (!own) continue;
      if (x + 1 < width && labels[p + 1] && labels[p + 1] !== own) link(y * corner + x + 1, (y + 1) * corner + x + 1);
      if (y + 1 < height && labels[p + width] && labels[p + width] !== own) link((y + 1) * corner + x, (y + 1) * corner + x + 1);
    }
  }
  const paths = CLASSES.map(() => new Path2D());
  const across = Math.ceil(width / SQUARE), down = Math.ceil(height / SQUARE);
  const kind = (x, y) => classOf(squares[Math.min(down - 1, y / SQUARE | 0) * across + Math.min(across - 1, x / SQUARE | 0)]);
  for (const chain of chains(links)) trace(chain, corner, kind, paths);
  return paths;
}

function* chains(links) {
  const walk = start => {
    const found = [start];
    let at = start;
    for (;;) {
      const near = links.get(at);
      if (!near?.length) return found;
      const next = near.pop();
      const back = links.get(next);
      back.splice(back.indexOf(at), 1);
      found.push(at = next);
      if (back.length !== 1) return found;
    }
  };
  const ends = [...links].filter(([, near]) => near.length !== 2).map(([at]) => at);
  for (const end of ends) while (links.get(end).length) yield walk(end);
  for (const [start, near] of links) while (near.length) yield walk(start);
}

function trace(chain, corner, kind, paths) {
  const xs = chain.map(at => at % corner), ys = chain.map(at => Math.floor(at / corner));
  const closed = chain[0] === chain.at(-1), last = chain.length - 1;
  const smooth = (values, k) => {
    const reach = closed ? 3 : Math.min(3, k, last - k);
    let sum = 0;
    for (let d = -reach; d <= reach; d++) sum += values[closed ? (k + d + last) % last : k + d];
    return sum / (2 * reach + 1);
  };
  let path = null, before = -1;
  for (let k = 0; k <= last; k++) {
    const x = smooth(xs, k), y = smooth(ys, k);
    path?.lineTo(x, y);
    const own = kind(xs[k], ys[k]);
    if (own !== before) { path = paths[before = own]; path.moveTo(x, y); }
  }
}
