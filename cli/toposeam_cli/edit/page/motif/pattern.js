// Densities in textures, printed on one cell; the cell laid over the screen by its rule; colours on top.
import { program } from '../program.js';
import { UNIT } from './lattice.js';

const MOST = 8, LEAST_SIDE = 256, MOST_SIDE = 2048;
const WRAP = 0, MIRROR = 1, TURN = 2, ROWS = 3, COLUMNS = 4, ALONE = 5;

// Densities are interpolated by Catmull and Rom's cubic; strokes end where they cross a level.
const PRINT = `#version 300 es
precision highp float; precision highp int; precision highp sampler2DArray;
uniform sampler2DArray density; uniform ivec2 shape; uniform vec2 size; uniform float share; uniform int count, rule;
uniform float ends[${MOST}], gains[${MOST}], strokes[${MOST}], inked[${MOST}];
layout(location = 0) out vec4 first; layout(location = 1) out vec4 second;
int over(int a, int n) { return a >= 0 ? a / n : -((n - 1 - a) / n); }
ivec2 place(ivec2 p) {
  int column = over(p.x, shape.x), row = over(p.y, shape.y);
  ivec2 q = p - ivec2(column, row) * shape;
  if (rule == ${MIRROR} || rule == ${ALONE}) { if ((column & 1) != 0) q.x = shape.x - 1 - q.x; if ((row & 1) != 0) q.y = shape.y - 1 - q.y; }
  if (rule == ${TURN} && ((row + column) & 1) != 0) q = shape - 1 - q;
  if (rule == ${ROWS}) { int moved = q.x - int(round(float(row) * share * float(shape.x))); q.x = moved - over(moved, shape.x) * shape.x; }
  if (rule == ${COLUMNS}) { int moved = q.y - int(round(float(column) * share * float(shape.y))); q.y = moved - over(moved, shape.y) * shape.y; }
  return q;
}
vec4 cubic(float t) {
  return vec4(t * (-.5 + t * (1. - .5 * t)), 1. + t * t * (-2.5 + 1.5 * t), t * (.5 + t * (2. - 1.5 * t)), t * t * (-.5 + .5 * t));
}
void main() {
  vec2 at = gl_FragCoord.xy / size * vec2(shape) - .5;
  ivec2 base = ivec2(floor(at));
  vec4 wx = cubic(at.x - float(base.x)), wy = cubic(at.y - float(base.y));
  bool inside = all(greaterThan(base, ivec2(0))) && all(lessThan(base, shape - 2));
  ivec2 places[16];
  for (int j = 0; j < 4; j++) for (int i = 0; i < 4; i++) { ivec2 p = base + ivec2(i - 1, j - 1); places[4 * j + i] = inside ? p : place(p); }
  float found[${MOST}];
  for (int k = 0; k < ${MOST}; k++) {
    found[k] = 0.;
    if (k >= count) continue;
    float f = 0.;
    for (int j = 0; j < 4; j++) {
      float across = 0.;
      for (int i = 0; i < 4; i++) across += wx[i] * texelFetch(density, ivec3(places[4 * j + i], k), 0).r;
      f += wy[j] * across;
    }
    float slope = abs(dFdx(f)) + abs(dFdy(f));
    float line = clamp((f - ends[k]) / max(slope, 1e-4) + .5, 0., 1.);
    if (inked[k] > .5) line *= clamp(f * gains[k], 0., 1.);
    found[k] = clamp(mix(f, line, strokes[k]), 0., 1.);
  }
  first = vec4(found[0], found[1], found[2], found[3]);
  second = vec4(found[4], found[5], found[6], found[7]);
}`;

const VIEW = `#version 300 es
precision highp float; precision highp int;
uniform sampler2D first, second; uniform vec3 cam; uniform float height, aspect, share; uniform int count, rule; uniform bool hexagonal, opaque, down;
uniform vec3 inks[${MOST}], paper;
out vec4 result;
void main() {
  vec2 pixel = vec2(gl_FragCoord.x, down ? gl_FragCoord.y : height - gl_FragCoord.y);
  vec2 p = (pixel - cam.xy) / cam.z / ${UNIT}.;
  vec2 at = hexagonal ? vec2(p.x + p.y * .57735026919, p.y * 1.15470053838) : vec2(p.x, p.y / aspect);
  vec2 dx = dFdx(at), dy = dFdy(at), cell = floor(at), q = at - cell;
  if (rule == ${ALONE} && cell != vec2(0)) { result = vec4(0); return; }
  bvec2 odd = notEqual(mod(cell, 2.), vec2(0));
  if (rule == ${MIRROR}) q = at; // the texture itself is mirrored
  if (rule == ${TURN} && odd.x != odd.y) q = 1. - q;
  if (rule == ${ROWS}) q.x -= cell.y * share;
  if (rule == ${COLUMNS}) q.y -= cell.x * share;
  vec4 a = textureGrad(first, q, dx, dy), b = count > 4 ? textureGrad(second, q, dx, dy) : vec4(0);
  vec3 colour = paper;
  for (int k = 0; k < ${MOST}; k++) {
    if (k >= count) break;
    float cover = k < 4 ? a[k] : b[k - 4];
    if (opaque) colour += cover * (inks[k] - colour);
    else colour *= 1. - cover * (1. - inks[k]);
  }
  result = vec4(clamp(colour, 0., 1.), 1);
}`;

// The rule of a lattice, as the shaders know it.
export function ruleOf(lattice) {
  const { repeat, shift } = lattice;
  if (shift) return shift[0] === 1 ? ROWS : COLUMNS;
  return { reflect: MIRROR, rotate: TURN, none: ALONE }[repeat] ?? WRAP;
}

export class Pattern {
  constructor(canvas) {
    this.canvas = canvas;
    const gl = this.gl = canvas.getContext('webgl2', { antialias: false, alpha: true, premultipliedAlpha: true, preserveDrawingBuffer: false });
    if (!gl) throw new Error('no WebGL 2');
    this.print = program(gl, PRINT);
    this.view = program(gl, VIEW);
    gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
  }

  // Returns what is printed of densities: textures that `draw` shows. `reuse` is printed over.
  printed(head, blocks, lattice, edges, side, reuse = null) {
    const gl = this.gl, [h, w] = head.shape, count = blocks.length;
    const cell = reuse ?? { side: 0, shape: [0, 0], count: 0 };
    gl.activeTexture(gl.TEXTURE0);
    if (cell.shape[0] !== h || cell.shape[1] !== w || cell.count !== count) {
      gl.deleteTexture(cell.density);
      cell.density = gl.createTexture();
      gl.bindTexture(gl.TEXTURE_2D_ARRAY, cell.density);
      gl.texParameteri(gl.TEXTURE_2D_ARRAY, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
      gl.texParameteri(gl.TEXTURE_2D_ARRAY, gl.TEXTURE_MAG_FILTER, gl.NEAREST);
      gl.texStorage3D(gl.TEXTURE_2D_ARRAY, 1, gl.R8, w, h, count);
      Object.assign(cell, { shape: [h, w], count });
    }
    gl.bindTexture(gl.TEXTURE_2D_ARRAY, cell.density);
    blocks.forEach((block, k) => gl.texSubImage3D(gl.TEXTURE_2D_ARRAY, 0, 0, 0, k, w, h, 1, gl.RED, gl.UNSIGNED_BYTE, block));
    Object.assign(cell, { lattice, edges, ends: head.ends, gains: head.gains, strokes: head.strokes });
    this.again(cell, side);
    return cell;
  }

  // Prints a cell on so many px across and down.
  again(cell, side) {
    const gl = this.gl, { lattice, count, shape: [h, w] } = cell;
    side = Math.min(MOST_SIDE, gl.getParameter(gl.MAX_TEXTURE_SIZE), Math.max(LEAST_SIDE, 2 ** Math.ceil(Math.log2(side))));
    const many = count > 4 ? 2 : 1;
    if (cell.side !== side || cell.covers.length !== many) {
      gl.deleteFramebuffer(cell.frame);
      for (const texture of cell.covers ?? []) gl.deleteTexture(texture);
      cell.covers = [0, 1].slice(0, many).map(() => this.cover(side));
      cell.frame = gl.createFramebuffer();
      gl.bindFramebuffer(gl.FRAMEBUFFER, cell.frame);
      cell.covers.forEach((texture, k) => gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0 + k, gl.TEXTURE_2D, texture, 0));
      cell.side = side;
    }
    gl.bindFramebuffer(gl.FRAMEBUFFER, cell.frame);
    gl.drawBuffers(many > 1 ? [gl.COLOR_ATTACHMENT0, gl.COLOR_ATTACHMENT1] : [gl.COLOR_ATTACHMENT0]);
    gl.viewport(0, 0, side, side);
    gl.useProgram(this.print.own);
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D_ARRAY, cell.density);
    const at = this.print.at, padded = values => new Float32Array(MOST).map((_, k) => values[k] ?? 0);
    gl.uniform1i(at('density'), 0);
    gl.uniform2i(at('shape'), w, h);
    gl.uniform2f(at('size'), side, side);
    gl.uniform1f(at('share'), lattice.shift?.[1] ?? 0);
    gl.uniform1i(at('count'), count);
    gl.uniform1i(at('rule'), ruleOf(lattice));
    gl.uniform1fv(at('ends'), padded(cell.ends));
    gl.uniform1fv(at('gains'), padded(cell.gains));
    gl.uniform1fv(at('strokes'), padded(cell.strokes));
    gl.uniform1fv(at('inked'), padded(cell.edges.map(edge => +(edge === 'ink'))));
    gl.drawArrays(gl.TRIANGLES, 0, 3);
    for (const texture of cell.covers) {
      gl.bindTexture(gl.TEXTURE_2D, texture);
      gl.generateMipmap(gl.TEXTURE_2D);
    }
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
  }

  cover(side) {
    const gl = this.gl, texture = gl.createTexture();
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR_MIPMAP_LINEAR);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.LINEAR);
    gl.texStorage2D(gl.TEXTURE_2D, 1 + Math.log2(side), gl.RGBA8, side, side);
    return texture;
  }

  // Draws a printed cell and its copies; `colours` are the paper, the inks, and whether these are opaque.
  draw(cell, colours, cam) { this.lay(cell, colours, cam, null, this.canvas.width, this.canvas.height, false); }

  lay(cell, { paper, inks, opaque }, cam, frame, width, height, down) {
    const gl = this.gl, at = this.view.at, { lattice } = cell;
    gl.bindFramebuffer(gl.FRAMEBUFFER, frame);
    gl.viewport(0, 0, width, height);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT);
    gl.useProgram(this.view.own);
    const rule = ruleOf(lattice), beyond = { [MIRROR]: [gl.MIRRORED_REPEAT, gl.MIRRORED_REPEAT], [TURN]: [gl.CLAMP_TO_EDGE, gl.CLAMP_TO_EDGE], [ALONE]: [gl.CLAMP_TO_EDGE, gl.CLAMP_TO_EDGE], [ROWS]: [gl.REPEAT, gl.CLAMP_TO_EDGE], [COLUMNS]: [gl.CLAMP_TO_EDGE, gl.REPEAT] }[rule] ?? [gl.REPEAT, gl.REPEAT];
    for (const k of [0, 1]) {
      gl.activeTexture(gl.TEXTURE0 + k);
      gl.bindTexture(gl.TEXTURE_2D, cell.covers[k] ?? cell.covers[0]);
      gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_S, beyond[0]);
      gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_T, beyond[1]);
    }
    gl.uniform1i(at('first'), 0);
    gl.uniform1i(at('second'), 1);
    gl.uniform3f(at('cam'), cam.x, cam.y, cam.z);
    gl.uniform1f(at('height'), height);
    gl.uniform1f(at('aspect'), lattice.aspect);
    gl.uniform1f(at('share'), lattice.shift?.[1] ?? 0);
    gl.uniform1i(at('count'), cell.count);
    gl.uniform1i(at('rule'), rule);
    gl.uniform1i(at('hexagonal'), +lattice.hexagonal);
    gl.uniform1i(at('opaque'), +opaque);
    gl.uniform1i(at('down'), +down);
    gl.uniform3fv(at('paper'), paper);
    gl.uniform3fv(at('inks'), new Float32Array(3 * MOST).map((_, k) => inks[Math.floor(k / 3)]?.[k % 3] ?? 1));
    gl.drawArrays(gl.TRIANGLES, 0, 3);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
  }

  // Paints a small picture of a printed cell in some colours on a canvas.
  thumb(cell, colours, canvas, cells) {
    const gl = this.gl, { width, height } = canvas;
    if (this.small?.width !== width || this.small?.height !== height) {
      const texture = gl.createTexture(), frame = gl.createFramebuffer();
      gl.activeTexture(gl.TEXTURE0);
      gl.bindTexture(gl.TEXTURE_2D, texture);
      gl.texStorage2D(gl.TEXTURE_2D, 1, gl.RGBA8, width, height);
      gl.bindFramebuffer(gl.FRAMEBUFFER, frame);
      gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, texture, 0);
      this.small = { width, height, frame };
    }
    this.lay(cell, colours, { x: 0, y: 0, z: width / UNIT / cells }, this.small.frame, width, height, true);
    const data = new Uint8ClampedArray(4 * width * height);
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.small.frame);
    gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, data);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    canvas.getContext('2d').putImageData(new ImageData(data, width, height), 0, 0);
  }
}
