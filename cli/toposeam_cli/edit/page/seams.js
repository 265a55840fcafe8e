// The page where seams move: what is drawn, and what the tools mean.
import { Camera } from './camera.js';
import { Crop } from './crop.js';
import { Gestures } from './gestures.js';
import { CLASSES, seamPaths } from './lines.js';
import { Panels } from './panels.js';
import { Picture } from './picture.js';
import { make, word } from './words.js';

const REST_MS = 333, PERIOD_MS = 50, SQUARE = 16;
const TOOLS = { push: 'b', hide: 'n', away: 'k', erase: 'e' };

export class Seams {
  constructor(shell, scene) {
    Object.assign(this, { shell, scene, tool: 'push', chosen: null, radius: 0, showSeams: true, before: false, lens: null, pointer: null, stroke: null, strokes: [], places: [], number: 0, tint: -1 });
    this.view = make('canvas', { 'aria-hidden': 'true' });
    this.over = make('canvas', { id: 'canvas', tabIndex: 0, role: 'application', 'aria-label': word('canvas') });
    this.element = make('section', { id: 'seams', className: 'hidden' }, this.view, this.over);
    shell.stage.append(this.element);
    this.picture = new Picture(this.view, scene);
    this.pen = this.over.getContext('2d');
    this.squares = new Uint8Array(Math.ceil(this.picture.width / SQUARE) * Math.ceil(this.picture.height / SQUARE)).fill(255);
    this.paths = [];
    this.camera = new Camera(() => this.draw());
    this.panels = new Panels(this);
    this.crop = new Crop(this, scene.crop);
    this.element.append(...this.crop.handles);
    shell.bars({ tools: () => this.tools(), extras: () => this.extras(), panels: () => this.panels.elements() });
    this.choose('push');
    this.gestures = new Gestures(this);
    this.resized = new ResizeObserver(() => this.fit());
    this.resized.observe(this.element);
    this.radius = Math.max(6, Math.round(Math.min(...scene.shape) / 28));
    window.toposeam = this; // for tests, and for people who look
    for (const text of scene.warnings) shell.say(text, 'bad');
  }

  async load(blocks) {
    await this.picture.load(blocks);
    this.loaded = true;
    this.panels.strip(blocks.slice(1));
    this.fit();
    this.unsettled = [0, 0, this.picture.height, this.picture.width];
  }

  remove() {
    this.gone = true;
    this.gestures.remove();
    this.resized.disconnect();
    this.element.remove();
    this.shell.bars(null);
    if (window.toposeam === this) delete window.toposeam;
  }

  show() { this.element.classList.remove('hidden'); this.rested(); }

  // --- bars
  tools() {
    const titles = { push: 'B', hide: 'N', away: 'K', erase: 'E' };
    const tools = Object.keys(TOOLS).map(name => this.shell.button(name, word(name), () => this.choose(name), { 'aria-pressed': 'false', title: `${word(`${name}_help`)} (${titles[name]})` }));
    const size = make('input', { type: 'range', id: 'size', min: 0, max: 1, step: 0.01, value: 0.35, title: `${word('size')} ([ ])`, 'aria-label': word('size'), oninput: event => this.resize(4 * 60 ** +event.target.value) });
    this.size = size;
    const seams = this.shell.button('seams-shown', word('seams'), () => this.toggleSeams(), { icon: 'seams', 'aria-pressed': 'true', title: `${word('seams_help')} (S)` });
    const before = this.shell.button('before', word('before'), null, { title: `${word('before_help')} (A)` });
    before.onpointerdown = () => this.showBefore(true);
    before.onpointerup = before.onpointerleave = before.onblur = () => this.showBefore(false);
    before.onkeydown = event => { if (event.key === 'Enter' || event.key === ' ') this.showBefore(true); };
    before.onkeyup = () => this.showBefore(false);
    return [...tools, make('span', { className: 'gap' }), size, make('span', { className: 'gap' }), seams, before];
  }

  extras() {
    const list = this.shell.button('list-shown', word('look_here'), () => this.panels.toggle('places'), { icon: 'list' });
    const more = this.shell.button('more-shown', word('more'), () => this.panels.toggle('more'), { icon: 'more', 'aria-expanded': 'false' });
    return [list, more];
  }

  choose(name) {
    this.tool = name;
    for (const tool of Object.keys(TOOLS)) document.getElementById(tool)?.setAttribute('aria-pressed', tool === name);
    this.draw();
  }

  resize(radius) {
    this.radius = Math.min(240, Math.max(3, radius));
    this.size.value = Math.log(this.radius / 4) / Math.log(60);
    this.draw();
  }

  toggleSeams() {
    this.showSeams = !this.showSeams;
    document.getElementById('seams-shown').setAttribute('aria-pressed', this.showSeams);
    this.draw();
  }

  showBefore(on) { if (this.before !== on) { this.before = on; this.draw(); } }

  pick(k) {
    this.chosen = this.chosen === k ? null : k;
    this.panels.picked(this.chosen);
  }

  // --- what the server says
  take(head, blocks) {
    const [top, left, bottom, right] = head.squares;
    const across = Math.ceil(this.picture.width / SQUARE);
    for (let row = top, k = 0; row < bottom; row++) for (let column = left; column < right; column++, k++) this.squares[row * across + column] = blocks[1][k];
    this.picture.put(head.box, blocks[0]);
    if (head.box[2] > head.box[0]) this.unsettle(head.box);
    if (bottom > top) this.paths = seamPaths(this.picture.labels, this.picture.width, this.picture.height, this.squares);
    if (head.lost) this.shell.say(word('no_pixels_there'));
    if (head.id != null && head.id === this.sent?.id) {
      this.waiting = false;
      if (head.done) { this.busy(false); this.fresh = null; }
      if (this.stroke && this.stroke.id === head.id) this.push();
    }
    if (head.id == null || head.done) this.rested();
    this.draw();
  }

  rest(head) {
    this.strokes = head.strokes;
    const was = this.places.length;
    this.places = head.places;
    this.panels.list();
    if (!was !== !head.places.length && !this.sent) this.fit();
    this.draw();
  }

  rested() {
    clearTimeout(this.restTimer);
    this.restTimer = setTimeout(() => {
      if (this.gone || this.stroke || !this.unsettled || !this.shell.owner) return;
      const [top, left, bottom, right] = this.unsettled, rim = 64;
      this.shell.send({ kind: 'blend', box: [Math.max(0, top - rim), Math.max(0, left - rim), Math.min(this.picture.height, bottom + rim), Math.min(this.picture.width, right + rim)] });
      this.unsettled = null;
    }, REST_MS);
  }

  unsettle(box) { this.unsettled = this.unsettled ? around(this.unsettled, box) : box; }

  async blended(box, block) {
    if (this.stroke || this.unsettled) { this.unsettle(box); return; } // it shows what was; another comes
    await this.picture.overlay(box, block);
    this.settled = true;
    this.panels.list();
    this.draw();
  }

  // --- strokes
  begin(at) {
    if (!this.shell.owner) return false;
    if (this.tool === 'erase' || this.tool === 'horizon') {
      this.stroke = { kind: this.tool, points: [[at.x, at.y]], id: ++this.number };
      return true;
    }
    const under = this.picture.at(at.x, at.y);
    const layer = this.tool === 'push' ? this.chosen ?? under : under;
    if (layer < 0) return false;
    this.stroke = { kind: this.tool === 'push' ? 'show' : this.tool, layer, points: [[at.x, at.y]], id: ++this.number };
    this.panels.picked(this.chosen, layer);
    return true;
  }

  extend(at) {
    if (this.stroke.kind === 'horizon') { this.stroke.points[1] = [at.x, at.y]; return; }
    const [x, y] = this.stroke.points.at(-1);
    if (Math.hypot(at.x - x, at.y - y) < Math.max(1, 0.15 * this.radius)) return;
    if (this.stroke.points.length < 4000) this.stroke.points.push([at.x, at.y]);
    this.push();
  }

  push() {
    if (!this.stroke || this.stroke.kind === 'erase' || this.stroke.kind === 'horizon' || this.waiting) return;
    const length = this.stroke.points.length, now = performance.now();
    if (length === this.stroke.told) return;
    if (now - (this.last ?? 0) < PERIOD_MS) {
      clearTimeout(this.pushTimer);
      this.pushTimer = setTimeout(() => this.push(), PERIOD_MS);
      return;
    }
    Object.assign(this, { last: now, waiting: true });
    this.stroke.told = length;
    this.tell(false);
  }

  tell(done) {
    const { id, kind, layer, points } = this.stroke;
    this.sent = { id };
    this.shell.send({ kind: 'stroke', id, stroke: kind, layer, points: points.map(rounded), radius: this.radius, done });
  }

  end() {
    const stroke = this.stroke;
    if (!stroke) return;
    clearTimeout(this.pushTimer);
    if (stroke.kind === 'erase') this.shell.send({ kind: 'erase', points: stroke.points.map(rounded), radius: this.radius });
    else if (stroke.kind === 'horizon') this.level(stroke.points);
    else { this.tell(true); this.busy(true); this.fresh = { ...stroke, radius: this.radius }; }
    this.stroke = null;
    this.panels.picked(this.chosen);
    this.draw();
  }

  level(points) {
    this.choose('push');
    if (points.length < 2) return;
    this.shell.send({ kind: 'horizon', points: points.map(rounded) });
    this.shell.say(word('again'));
  }

  cancel() {
    if (this.tool === 'horizon') this.choose('push');
    if (!this.stroke) return;
    this.stroke = null;
    this.panels.picked(this.chosen);
    this.shell.send({ kind: 'refresh' });
    this.draw();
  }

  busy(on) { this.element.classList.toggle('busy', on); }

  // --- the lens
  openLens(at, stays = false) {
    const others = this.picture.others(at.x, at.y);
    if (!others.length) { this.closeLens(); return false; }
    const before = this.lens && others.includes(this.lens.layer) ? this.lens.layer : others[0];
    this.lens = { x: at.x, y: at.y, others, layer: before, stays };
    this.panels.lens(this.lens);
    this.draw();
    return true;
  }

  closeLens() {
    if (!this.lens) return;
    this.lens = null;
    this.panels.lens(null);
    this.draw();
  }

  turnLens(step) {
    if (!this.lens) return;
    const { others, layer } = this.lens;
    this.lens.layer = others[(others.indexOf(layer) + step + others.length) % others.length];
    this.panels.lens(this.lens);
    this.draw();
  }

  takeThing() {
    if (!this.lens || !this.shell.owner) return;
    const { x, y, layer } = this.lens;
    this.shell.send({ kind: 'take', x, y, layer });
    this.busy(true);
    this.closeLens();
    setTimeout(() => this.busy(false), 1500);
  }

  get lensRadius() { return Math.max(90 * devicePixelRatio / this.camera.z, 1.5 * this.radius); }

  otherWay(place) {
    this.shell.send({ kind: 'other', x: place.x, y: place.y });
    this.goTo(place);
  }

  // --- where one looks
  get room() {
    const at = (id, side) => { const box = document.getElementById(id)?.getBoundingClientRect(); return box && box.height ? box[side] : null; };
    const narrow = innerWidth <= 760;
    const calm = this.panels.places.classList.contains('empty');
    const top = narrow ? (at('steps', 'bottom') ?? 0) : Math.max(at('tools', 'bottom') ?? 0, (calm ? at('places', 'bottom') : at('steps', 'bottom')) ?? 0);
    const bottom = Math.min(at('strip', 'top') ?? innerHeight, narrow ? at('tools', 'top') ?? innerHeight : innerHeight);
    const right = narrow || calm ? innerWidth : at('places', 'left') ?? innerWidth;
    const gap = narrow ? 8 : 20, d = devicePixelRatio;
    return { left: gap * d, top: (top + gap) * d, width: Math.max(60, right - 2 * gap) * d, height: Math.max(60, bottom - top - 2 * gap) * d };
  }

  fit() {
    const d = devicePixelRatio;
    for (const canvas of [this.view, this.over]) {
      canvas.width = Math.round(this.element.clientWidth * d);
      canvas.height = Math.round(this.element.clientHeight * d);
    }
    this.camera.fit(this.picture.width, this.picture.height, this.room);
  }

  goTo(place) {
    const z = Math.max(this.camera.z, Math.min(3, 2 * devicePixelRatio));
    this.camera.fly(place.x, place.y, z, this.room);
    this.looked = place;
  }

  rectOf(name) {
    const layer = this.scene.layers.find(one => one.name === name);
    if (!layer) return null;
    const [x, y, width, height] = layer.box, from = this.camera.toScreen(x, y), to = this.camera.toScreen(x + width, y + height);
    return { x: from.x, y: from.y, width: to.x - from.x, height: to.y - from.y };
  }

  // --- drawing
  draw() {
    if (this.due || this.gone || !this.loaded) return;
    this.due = true;
    requestAnimationFrame(() => { this.due = false; if (!this.gone) this.paint(); });
  }

  paint() {
    const { camera, pen, lens } = this, d = devicePixelRatio, px = 1 / camera.z;
    this.picture.draw(camera, { before: this.before, tint: this.tint, lens: lens && { ...lens, radius: this.lensRadius } });
    pen.resetTransform();
    pen.clearRect(0, 0, this.over.width, this.over.height);
    pen.setTransform(camera.z, 0, 0, camera.z, camera.x, camera.y);
    pen.lineCap = pen.lineJoin = 'round';
    if (this.showSeams && !this.before) this.paintSeams(pen, d * px);
    if (this.tool === 'erase') this.paintStrokes(pen, d * px);
    const drawn = this.stroke?.kind;
    if (drawn === 'horizon') this.line(pen, this.stroke.points, d * px);
    else if (drawn && drawn !== 'show') this.paintStroke(pen, { ...this.stroke, radius: this.radius });
    if (!this.before) this.crop.paint(pen, d * px);
    if (lens) this.ring(pen, lens.x, lens.y, this.lensRadius, 2 * d * px, [8 * d * px, 6 * d * px]);
    const looked = this.looked;
    if (looked && this.showSeams) this.ring(pen, looked.x, looked.y, 34 * d * px, 1.5 * d * px, [4 * d * px, 4 * d * px]);
    if (this.pointer && !this.before && this.tool !== 'horizon') this.ring(pen, this.pointer.x, this.pointer.y, this.radius, (this.stroke ? 2.5 : 1.5) * d * px);
  }

  paintSeams(pen, px) {
    pen.strokeStyle = '#000000a0';
    pen.setLineDash([]);
    pen.lineWidth = 4.5 * px;
    for (const path of this.paths) pen.stroke(path);
    this.paths.forEach((path, k) => {
      pen.strokeStyle = CLASSES[k].colour;
      pen.lineWidth = 2.2 * px;
      pen.lineCap = 'butt';
      pen.setLineDash(CLASSES[k].dash.map(value => value * px));
      pen.stroke(path);
    });
    pen.lineCap = 'round';
    pen.setLineDash([]);
  }

  paintStrokes(pen) { for (const stroke of this.strokes) this.paintStroke(pen, stroke); }

  paintStroke(pen, stroke) {
    pen.strokeStyle = { show: '#4da3ff66', hide: '#ff6b6b66', away: '#ffd16666', erase: '#ffffff55' }[stroke.kind];
    pen.lineWidth = 2 * stroke.radius;
    pen.beginPath();
    stroke.points.forEach(([x, y], k) => k ? pen.lineTo(x, y) : pen.moveTo(x, y));
    if (stroke.points.length === 1) pen.lineTo(stroke.points[0][0] + 0.01, stroke.points[0][1]);
    pen.stroke();
  }

  line(pen, points, px) {
    for (const [colour, width] of [['#000000b0', 5], ['#fff', 2.5]]) {
      pen.strokeStyle = colour;
      pen.lineWidth = width * px;
      pen.beginPath();
      points.forEach(([x, y], k) => k ? pen.lineTo(x, y) : pen.moveTo(x, y));
      pen.stroke();
    }
  }

  ring(pen, x, y, radius, width, dash = []) {
    for (const [colour, more] of [['#000000b0', 2], ['#fff', 1]]) {
      pen.strokeStyle = colour;
      pen.lineWidth = width * more;
      pen.setLineDash(more === 2 ? [] : dash);
      pen.beginPath();
      pen.arc(x, y, radius, 0, 7);
      pen.stroke();
    }
    pen.setLineDash([]);
  }

  // --- keys
  key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey || /^(input|select|textarea)$/i.test(event.target.tagName)) return false;
    const key = event.key.toLowerCase(), tool = Object.keys(TOOLS).find(name => TOOLS[name] === key);
    if (tool) this.choose(tool);
    else if (key === '[' || key === ']') this.resize(this.radius * (key === ']' ? 1.2 : 1 / 1.2));
    else if (key === 's') this.toggleSeams();
    else if (key === 'a') this.showBefore(true);
    else if (key === 'j') this.panels.step(event.shiftKey ? -1 : 1);
    else if (key === 'o') this.panels.otherWay();
    else if (key === '0') this.fit();
    else if (key === '+' || key === '-') this.camera.zoom(key === '+' ? 1.25 : 0.8, innerWidth / 2, innerHeight / 2);
    else if (/^[1-9]$/.test(key) && +key <= this.scene.layers.length) this.pick(+key - 1);
    else return false;
    return true;
  }
}

const rounded = point => point.map(value => Math.round(value * 10) / 10);
const around = (a, b) => [Math.min(a[0], b[0]), Math.min(a[1], b[1]), Math.max(a[2], b[2]), Math.max(a[3], b[3])];
