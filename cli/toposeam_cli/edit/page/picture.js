// Pictures in textures, and a map of labels that says which shows: blended, seen through a lens, or as it was.
import { program } from './program.js';

const LOW = 8; // pixels of a low picture are so many of its own
const RADIUS = 48; // px of the canvas over which tones are blended

const COMMON = `#version 300 es
precision highp float; precision highp int; precision highp sampler2DArray; precision highp usampler2D;
uniform sampler2DArray pages, lows; uniform usampler2D labels; uniform sampler2D rects;
uniform vec2 whole, page, low;
out vec4 result;
int label(vec2 c) { return int(texelFetch(labels, ivec2(clamp(c, vec2(0), whole - 1.)), 0).r) - 1; }
vec4 pixel(int k, vec2 c) {
  vec4 r = texelFetch(rects, ivec2(0, k), 0), a = texelFetch(rects, ivec2(1, k), 0);
  vec2 p = c - r.xy;
  if (any(lessThan(p, vec2(0))) || any(greaterThanEqual(p, r.zw))) return vec4(0);
  return texture(pages, vec3((a.xy + clamp(p, vec2(.5), r.zw - .5)) / page, a.z));
}`;

const BLEND = `${COMMON}
uniform bool blends;
vec4 tone(int k, vec2 c) {
  vec4 r = texelFetch(rects, ivec2(0, k), 0);
  return textureLod(lows, vec3((c - r.xy) / low, float(k)), 1.);
}
vec2 around(int i, int n) { float t = float(i) * 2.39996; return sqrt((float(i) + .5) / float(n)) * vec2(cos(t), sin(t)) * ${RADIUS}.; }
void main() {
  vec2 c = gl_FragCoord.xy;
  int k = label(c);
  if (k < 0) { result = vec4(0); return; }
  vec4 own = pixel(k, c);
  result = vec4(own.rgb, 1);
  if (!blends) return;
  bool alone = true;
  for (int i = 20; i < 32; i++) { int j = label(c + around(i, 32)); alone = alone && (j == k || j < 0); }
  for (int i = 0; i < 32; i += 5) { int j = label(c + around(i, 32)); alone = alone && (j == k || j < 0); }
  if (alone) return;
  vec4 mine = tone(k, c);
  vec3 more = vec3(0);
  for (int i = 0; i < 32; i++) {
    int j = label(c + around(i, 32));
    if (j < 0 || j == k || pixel(j, c).a < .5) continue;
    vec4 other = tone(j, c);
    more += other.rgb / max(other.a, .02) - mine.rgb / max(mine.a, .02);
  }
  result.rgb = clamp(own.rgb + more / 32., 0., 1.);
}`;

const VIEW = `${COMMON}
uniform sampler2D picture; uniform vec3 cam; uniform vec2 size; uniform vec4 lens; uniform int tint;
void main() {
  vec2 c = (vec2(gl_FragCoord.x, size.y - gl_FragCoord.y) - cam.xy) / cam.z;
  result = vec4(0);
  if (any(lessThan(c, vec2(0))) || any(greaterThanEqual(c, whole))) return;
  int k = label(c);
  vec4 own = texture(picture, c / whole); // 0 where nothing is, which must not darken the rim
  vec4 shown = k < 0 ? vec4(0) : vec4(own.rgb / max(own.a, .01), 1);
  if (tint >= 0 && k != tint) shown.rgb = mix(vec3(dot(shown.rgb, vec3(.3, .6, .1))), shown.rgb, .25) * .6;
  if (lens.w >= 0.) {
    float inside = 1. - smoothstep(lens.z - 10. / cam.z, lens.z, distance(c, lens.xy));
    vec4 other = pixel(int(lens.w), c);
    shown = mix(shown, vec4(other.rgb, 1), inside * step(.5, other.a));
  }
  if (shown.a < .5) {
    bool dark = ((int(gl_FragCoord.x) >> 3) + (int(gl_FragCoord.y) >> 3) & 1) == 1;
    result = vec4(vec3(.5), 1) * (dark ? .13 : .06);
    return;
  }
  result = vec4(shown.rgb, 1);
}`;

export class Picture {
  constructor(canvas, scene) {
    this.canvas = canvas;
    const gl = this.gl = canvas.getContext('webgl2', { antialias: false, premultipliedAlpha: true, preserveDrawingBuffer: true });
    if (!gl) throw new Error('WebGL 2');
    [this.height, this.width] = scene.shape;
    this.layers = scene.layers;
    this.blends = scene.blends;
    this.opacity = []; // of each picture, at a small size
    this.labels = new Uint8Array(this.width * this.height);
    gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
    gl.bindVertexArray(gl.createVertexArray());
    this.blend = program(gl, BLEND);
    this.view = program(gl, VIEW);
    this.shown = this.target(3);
    this.before = this.target(4);
  }

  async load(blocks) {
    const gl = this.gl;
    const images = await Promise.all(blocks.slice(1).map(block => createImageBitmap(new Blob([block], { type: 'image/webp' }), { premultiplyAlpha: 'none' })));
    this.pack(images);
    const size = Math.max(...images.map(one => one.width), 1), tall = Math.max(...images.map(one => one.height), 1);
    this.low = [Math.ceil(size / LOW) * LOW, Math.ceil(tall / LOW) * LOW];
    this.texture(1, gl.TEXTURE_2D_ARRAY, gl.LINEAR, gl.LINEAR_MIPMAP_NEAREST);
    gl.texStorage3D(gl.TEXTURE_2D_ARRAY, 3, gl.RGBA8, this.low[0] / LOW, this.low[1] / LOW, images.length);
    for (const [k, image] of images.entries()) {
      const small = await createImageBitmap(image, 0, 0, this.low[0], this.low[1], { resizeWidth: this.low[0] / LOW, resizeHeight: this.low[1] / LOW, resizeQuality: 'medium', premultiplyAlpha: 'premultiply' });
      const pen = new OffscreenCanvas(small.width, small.height).getContext('2d');
      pen.drawImage(small, 0, 0);
      this.opacity.push(pen.getImageData(0, 0, small.width, small.height));
      gl.activeTexture(gl.TEXTURE1);
      gl.texSubImage3D(gl.TEXTURE_2D_ARRAY, 0, 0, 0, k, small.width, small.height, 1, gl.RGBA, gl.UNSIGNED_BYTE, small);
    }
    gl.generateMipmap(gl.TEXTURE_2D_ARRAY);
    this.texture(2, gl.TEXTURE_2D, gl.NEAREST, gl.NEAREST);
    gl.texStorage2D(gl.TEXTURE_2D, 1, gl.R8UI, this.width, this.height);
    for (const program of [this.blend, this.view]) {
      gl.useProgram(program.own);
      ['pages', 'lows', 'labels', 'picture', 'rects'].forEach((name, k) => gl.uniform1i(program.at(name), k === 4 ? 5 : k));
      gl.uniform2f(program.at('whole'), this.width, this.height);
      gl.uniform2f(program.at('page'), this.page, this.page);
      gl.uniform2f(program.at('low'), ...this.low);
    }
    this.first = blocks[0].slice();
    this.put([0, 0, this.height, this.width], this.first);
    this.paint(this.before, [0, 0, this.height, this.width]);
  }

  // Lays pictures on as few square pages as they fit on, row by row.
  pack(images) {
    const gl = this.gl, order = images.map((_, k) => k).sort((a, b) => images[b].height - images[a].height);
    const area = images.reduce((sum, one) => sum + (one.width + 2) * (one.height + 2), 0);
    const least = Math.max(...images.map(one => Math.max(one.width, one.height))) + 2;
    this.page = Math.min(gl.getParameter(gl.MAX_TEXTURE_SIZE), Math.max(least, Math.min(4096, Math.ceil(1.1 * Math.sqrt(area)))));
    const places = [];
    let x = 0, y = 0, row = 0, sheet = 0;
    for (const k of order) {
      const { width, height } = images[k];
      if (x + width + 2 > this.page) { x = 0; y += row; row = 0; }
      if (y + height + 2 > this.page) { x = y = row = 0; sheet += 1; }
      places[k] = [x + 1, y + 1, sheet];
      x += width + 2;
      row = Math.max(row, height + 2);
    }
    this.texture(0, gl.TEXTURE_2D_ARRAY, gl.LINEAR, gl.LINEAR);
    gl.texStorage3D(gl.TEXTURE_2D_ARRAY, 1, gl.RGBA8, this.page, this.page, sheet + 1);
    images.forEach((image, k) => gl.texSubImage3D(gl.TEXTURE_2D_ARRAY, 0, ...places[k], image.width, image.height, 1, gl.RGBA, gl.UNSIGNED_BYTE, image));
    const table = new Float32Array(images.length * 8);
    this.layers.forEach((layer, k) => table.set([...layer.box, ...places[k], 0], 8 * k));
    this.texture(5, gl.TEXTURE_2D, gl.NEAREST, gl.NEAREST);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA32F, 2, images.length, 0, gl.RGBA, gl.FLOAT, table);
  }

  texture(unit, kind, larger, smaller) {
    const gl = this.gl, own = gl.createTexture();
    gl.activeTexture(gl.TEXTURE0 + unit);
    gl.bindTexture(kind, own);
    gl.texParameteri(kind, gl.TEXTURE_MAG_FILTER, larger);
    gl.texParameteri(kind, gl.TEXTURE_MIN_FILTER, smaller);
    gl.texParameteri(kind, gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE);
    gl.texParameteri(kind, gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE);
    return own;
  }

  target(unit) {
    const gl = this.gl, texture = this.texture(unit, gl.TEXTURE_2D, gl.LINEAR, gl.LINEAR_MIPMAP_LINEAR);
    const levels = 1 + Math.floor(Math.log2(Math.max(this.width, this.height)));
    gl.texStorage2D(gl.TEXTURE_2D, levels, gl.RGBA8, this.width, this.height);
    const frame = gl.createFramebuffer();
    gl.bindFramebuffer(gl.FRAMEBUFFER, frame);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, texture, 0);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    return { unit, texture, frame };
  }

  // Takes over labels, plus one, of a box [top, left, bottom, right].
  put([top, left, bottom, right], block) {
    const gl = this.gl, width = right - left, height = bottom - top;
    if (!width || !height) return;
    for (let row = 0; row < height; row++) this.labels.set(block.subarray(row * width, (row + 1) * width), (top + row) * this.width + left);
    gl.activeTexture(gl.TEXTURE2);
    gl.texSubImage2D(gl.TEXTURE_2D, 0, left, top, width, height, gl.RED_INTEGER, gl.UNSIGNED_BYTE, block);
    this.paint(this.shown, [Math.max(0, top - RADIUS), Math.max(0, left - RADIUS), Math.min(this.height, bottom + RADIUS), Math.min(this.width, right + RADIUS)]);
  }

  paint(target, [top, left, bottom, right]) {
    const gl = this.gl;
    gl.bindFramebuffer(gl.FRAMEBUFFER, target.frame);
    gl.viewport(0, 0, this.width, this.height);
    gl.enable(gl.SCISSOR_TEST);
    gl.scissor(left, top, right - left, bottom - top);
    gl.useProgram(this.blend.own);
    gl.uniform1i(this.blend.at('blends'), this.blends ? 1 : 0);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
    gl.disable(gl.SCISSOR_TEST);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    this.stale = true;
  }

  // Puts core's own blend of a box over the one of the shader.
  async overlay([top, left], block) {
    const gl = this.gl, image = await createImageBitmap(new Blob([block], { type: 'image/jpeg' }));
    const { width, height } = image, canvas = new OffscreenCanvas(width, height), pen = canvas.getContext('2d');
    pen.drawImage(image, 0, 0);
    const { data } = pen.getImageData(0, 0, width, height);
    for (let row = 0, k = 0; row < height; row++) {
      const start = (top + row) * this.width + left;
      for (let column = 0; column < width; column++, k += 4) if (!this.labels[start + column]) data.fill(0, k, k + 4);
    }
    gl.activeTexture(gl.TEXTURE3);
    gl.texSubImage2D(gl.TEXTURE_2D, 0, left, top, width, height, gl.RGBA, gl.UNSIGNED_BYTE, data);
    this.stale = true;
  }

  draw(cam, { lens = null, before = false, tint = -1 } = {}) {
    const gl = this.gl, target = before ? this.before : this.shown;
    if (this.stale) {
      gl.activeTexture(gl.TEXTURE3);
      gl.generateMipmap(gl.TEXTURE_2D);
      gl.activeTexture(gl.TEXTURE4);
      gl.generateMipmap(gl.TEXTURE_2D);
      this.stale = false;
    }
    gl.viewport(0, 0, this.canvas.width, this.canvas.height);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT);
    gl.useProgram(this.view.own);
    gl.uniform1i(this.view.at('picture'), target.unit);
    gl.uniform3f(this.view.at('cam'), cam.x, cam.y, cam.z);
    gl.uniform2f(this.view.at('size'), this.canvas.width, this.canvas.height);
    gl.uniform4f(this.view.at('lens'), lens?.x ?? 0, lens?.y ?? 0, lens?.radius ?? 0, lens?.layer ?? -1);
    gl.uniform1i(this.view.at('tint'), tint);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }

  // Returns a part of the blended picture as image data.
  part(x, y, width, height) {
    const gl = this.gl, left = Math.max(0, Math.min(this.width - width, Math.round(x - width / 2))), top = Math.max(0, Math.min(this.height - height, Math.round(y - height / 2)));
    const data = new Uint8ClampedArray(width * height * 4);
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.shown.frame);
    gl.readPixels(left, top, width, height, gl.RGBA, gl.UNSIGNED_BYTE, data);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    for (let row = 0; row < height; row++) for (let column = 0; column < width; column++) if (!this.labels[(top + row) * this.width + left + column]) data[4 * (row * width + column) + 3] = 0;
    return { image: new ImageData(data, width, height), left, top };
  }

  at(x, y) {
    return x < 0 || y < 0 || x >= this.width || y >= this.height ? -1 : this.labels[Math.floor(y) * this.width + Math.floor(x)] - 1;
  }

  // The other pictures that have pixels at a point.
  others(x, y) {
    const own = this.at(x, y);
    return this.layers.map((_, k) => k).filter(k => k !== own && this.covers(k, x, y));
  }

  covers(k, x, y) {
    const [left, top, width, height] = this.layers[k].box;
    if (x < left || y < top || x >= left + width || y >= top + height) return false;
    const small = this.opacity[k];
    return small.data[4 * (Math.floor((y - top) / LOW) * small.width + Math.floor((x - left) / LOW)) + 3] > 127;
  }
}
