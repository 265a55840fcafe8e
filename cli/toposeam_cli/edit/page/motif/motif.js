// The page of a motif: what is shown, and what the tools mean.
import { Camera } from '../camera.js';
import { Gestures } from '../gestures.js';
import { make, word } from '../words.js';
import { Lattice, UNIT } from './lattice.js';
import { MotifPanels } from './panels.js';
import { Pattern } from './pattern.js';
import { Strip } from './strip.js';

const TOOLS = { hand: 'h', source: 's', sink: 'd', wall: 'w', erase: 'e' };
const ROLES = { source: 'sources', sink: 'sinks' };
const APART = 0.045, MOST_SPOTS = 60, NEAR_PX = 16, PERIOD_MS = 50, MOST_DRAWN = 6000, SHOWN_CELLS = 2.2, MOVING_SIDE = 512;

export class Motif {
  constructor(shell, offer) {
    Object.assign(this, { shell, offer, tool: 'hand', radius: 8, ink: null, spots: false, pointer: null, stroke: null, lens: null, share: 0, final: false, seconds: 0 });
    this.view = make('canvas', { 'aria-hidden': 'true' });
    this.over = make('canvas', { id: 'canvas', tabIndex: 0, role: 'application', 'aria-label': word('motif_canvas') });
    this.element = make('section', { id: 'motif' }, this.view, this.over);
    shell.stage.append(this.element);
    this.pattern = new Pattern(this.view);
    this.pen = this.over.getContext('2d');
    this.camera = new Camera(() => this.draw());
    this.panels = new MotifPanels(this);
    this.strip = new Strip(this);
    this.picture = { at: () => -1 }; // gestures look at no pictures here
    shell.bars({ tools: () => this.tools(), extras: () => this.extras(), panels: () => [this.panels.element, this.panels.more, this.strip.element], saving: () => this.panels.saving });
    this.choose('hand');
    this.gestures = new Gestures(this);
    this.resized = new ResizeObserver(() => this.fit());
    this.resized.observe(this.element);
    window.toposeam = this; // for tests, and for people who look
  }

  remove() {
    this.gone = true;
    this.gestures.remove();
    this.resized.disconnect();
    this.element.remove();
    this.shell.bars(null);
    if (window.toposeam === this) delete window.toposeam;
  }

  // --- bars
  tools() {
    const tools = Object.keys(TOOLS).map(name => this.shell.button(name, word(name), () => this.choose(name), { 'aria-pressed': 'false', title: `${word(name === 'erase' ? 'rub_help' : `${name}_help`)} (${TOOLS[name].toUpperCase()})` }));
    this.size = make('input', { type: 'range', id: 'size', min: 0, max: 1, step: 0.01, value: 0.4, title: `${word('size')} ([ ])`, 'aria-label': word('size'), oninput: event => this.resize(2 * 32 ** +event.target.value) });
    const spots = this.shell.button('spots', word('spots'), () => this.showSpots(!this.spots), { 'aria-pressed': 'false', title: `${word('spots_help')} (P)` });
    return [...tools, make('span', { className: 'gap' }), this.size, make('span', { className: 'gap' }), spots];
  }

  extras() {
    return [
      this.shell.button('dice', word('dice'), () => this.dice(), { title: `${word('dice_help')} (R)` }),
      this.shell.button('relatives', word('relatives'), () => this.relatives(), { title: `${word('relatives')} (M)` }),
      this.shell.button('list-shown', word('motif'), () => this.panels.toggle('element'), { icon: 'list', 'aria-expanded': 'true' }),
      this.shell.button('more-shown', word('more'), () => this.panels.toggle('more'), { icon: 'more', 'aria-expanded': 'false' }),
    ];
  }

  choose(name) {
    this.tool = name;
    for (const tool of Object.keys(TOOLS)) document.getElementById(tool)?.setAttribute('aria-pressed', tool === name);
    this.element.dataset.tool = name;
    if (name !== 'hand') this.showSpots(true);
    this.draw();
  }

  showSpots(on) {
    this.spots = on;
    document.getElementById('spots')?.setAttribute('aria-pressed', on);
    this.draw();
  }

  resize(radius) {
    this.radius = Math.min(64, Math.max(2, radius));
    this.size.value = Math.log(this.radius / 2) / Math.log(32);
    this.draw();
  }

  pick(ink) {
    this.ink = ink;
    this.panels.show();
    this.draw();
  }

  dice() {
    const { styles, repeat } = this.panels.locked;
    this.send({ kind: 'dice', seed: Math.floor(Math.random() * 2 ** 31), style: styles, repeat });
  }

  relatives() { this.send({ kind: 'relatives', seed: Math.floor(Math.random() * 2 ** 30) }); }

  send(message) { if (this.shell.owner) this.shell.send(message); }

  // --- what the server says
  take(head) {
    const before = this.state;
    this.state = head;
    this.final = head.final; // until the changed motif is there, the former one is shown
    this.lattice = new Lattice(head);
    if (this.ink >= head.layers.length) this.ink = null;
    this.colours = { paper: head.paper, inks: head.layers.map(layer => layer.ink), opaque: head.inking === 'opaque' };
    this.panels.show();
    this.panels.status();
    if (before && (before.repeat !== head.repeat || before.size.join() !== head.size.join())) this.fit();
    if (this.cell && before && JSON.stringify([before.paper, before.inking, before.layers.map(one => one.ink)]) !== JSON.stringify([head.paper, head.inking, head.layers.map(one => one.ink)])) this.strip.later();
    this.draw();
  }

  grown(head, blocks) {
    if (blocks.length !== this.state.layers.length) return;
    Object.assign(this, { share: head.share, final: head.final, seconds: head.seconds, frames: (this.frames ?? 0) + 1 });
    // What comes faster than it can be drawn is left out.
    this.fresh = { head, blocks: blocks.map(block => block.slice()), lattice: this.lattice, edges: this.state.layers.map(layer => layer.edge) };
    this.panels.status();
    if (head.share === 1) this.strip.later();
    this.draw();
  }

  // Prints what came last.
  refresh() {
    const { head, blocks, lattice, edges } = this.fresh;
    this.fresh = null;
    const side = Math.min(4 * head.shape[1], head.share === 1 ? this.needed : MOVING_SIDE);
    this.cell = this.pattern.printed(head, blocks, lattice, edges, side, this.cell);
    if (!this.placed) this.fit();
  }

  // Px of the screen that a cell covers.
  get needed() { return UNIT * this.camera.z; }

  // Shows colours before the server has them; `done` once they are chosen.
  recolour(colours, done) {
    this.colours = { ...this.colours, ...colours };
    const { paper, inks, opaque } = this.colours;
    this.send({ kind: 'colours', paper, inks, inking: opaque ? 'opaque' : 'transparent', done });
    this.draw();
  }

  // --- gestures, as `Gestures` asks for them
  begin(at) {
    if (!this.shell.owner || !this.state) return false;
    if (this.tool === 'hand') {
      const held = this.spots ? this.spotAt(at) : null;
      this.stroke = held ? { kind: 'move', held, points: [at] } : { kind: 'pan', from: at, points: [at] };
    } else this.stroke = { kind: this.tool, points: [at] };
    return true;
  }

  extend(at) {
    const { stroke } = this;
    if (stroke.kind === 'pan') {
      const d = devicePixelRatio, { z } = this.camera;
      this.camera.pan((at.x - stroke.from.x) * z / d, (at.y - stroke.from.y) * z / d);
      return;
    }
    const last = stroke.points.at(-1);
    if (Math.hypot(at.x - last.x, at.y - last.y) < 1.5) return;
    if (stroke.kind === 'move') { stroke.points = [at]; this.moved(false); } else if (stroke.points.length < 2000) stroke.points.push(at);
    this.draw();
  }

  end() {
    const { stroke } = this;
    if (!stroke) return;
    this.stroke = null;
    const places = points => points.map(point => rounded(this.lattice.inCell(this.lattice.fromCanvas(point))));
    if (stroke.kind === 'move') { this.stroke = stroke; this.moved(true); this.stroke = null; }
    else if (stroke.kind === 'wall' || stroke.kind === 'erase') this.send({ kind: stroke.kind, points: places(stroke.points), radius: this.radius / UNIT });
    else if (stroke.kind in ROLES) this.send({ kind: 'add', layer: this.ink, role: ROLES[stroke.kind], points: places(spaced(stroke.points)) });
    this.draw();
  }

  cancel() {
    if (this.stroke?.kind === 'move' && this.stroke.told) { // back to where it was
      this.stroke.points = [this.stroke.held];
      this.moved(true);
    }
    this.stroke = null;
    this.draw();
  }

  moved(done) {
    const { held, points } = this.stroke, now = performance.now();
    if (!done && now - (this.last ?? 0) < PERIOD_MS) return;
    this.last = now;
    this.stroke.told = true;
    const place = this.lattice.undo(held.operation, this.lattice.inCell(this.lattice.fromCanvas(points[0])));
    this.send({ kind: 'move', layer: held.layer, role: held.role, index: held.index, points: [rounded(place)], done });
  }

  spotAt(at) {
    const reach = NEAR_PX * devicePixelRatio / this.camera.z;
    let found = null;
    for (const spot of this.copies()) {
      const far = Math.hypot(spot.x - at.x, spot.y - at.y);
      if (far < reach && far < (found?.far ?? Infinity)) found = { ...spot, far };
    }
    return found;
  }

  openLens() { return false; }
  closeLens() {}
  turnLens() {}
  takeThing() {}

  key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey || /^(input|select|textarea)$/i.test(event.target.tagName)) return false;
    const key = event.key.toLowerCase(), tool = Object.keys(TOOLS).find(name => TOOLS[name] === key);
    if (tool) this.choose(tool);
    else if (key === '[' || key === ']') this.resize(this.radius * (key === ']' ? 1.2 : 1 / 1.2));
    else if (key === 'p') this.showSpots(!this.spots);
    else if (key === 'r') this.dice();
    else if (key === 'm') this.relatives();
    else if (key === 'f') this.send({ kind: 'finish' });
    else if (key === '0') this.fit(true);
    else if (key === '+' || key === '-') this.camera.zoom(key === '+' ? 1.25 : 0.8, innerWidth / 2, innerHeight / 2);
    else if (/^[1-8]$/.test(key) && +key <= this.state.layers.length) this.pick(this.ink === +key - 1 ? null : +key - 1);
    else return false;
    return true;
  }

  // --- where one looks
  get room() {
    const d = devicePixelRatio, box = id => document.getElementById(id)?.getBoundingClientRect();
    const narrow = innerWidth <= 760, side = box('design');
    const right = !narrow && side?.height ? side.left : innerWidth;
    const bottom = narrow ? box('tools')?.top ?? innerHeight : box('strip')?.top ?? innerHeight;
    return { left: 0, top: 0, width: right * d, height: bottom * d };
  }

  fit(again = false) {
    const d = devicePixelRatio;
    for (const canvas of [this.view, this.over]) {
      canvas.width = Math.round(this.element.clientWidth * d);
      canvas.height = Math.round(this.element.clientHeight * d);
    }
    if (this.lattice && (!this.placed || again || this.fitted !== this.lattice.repeat)) {
      const { room } = this, corners = this.lattice.corners(0, 0);
      const middle = { x: (Math.min(...corners.map(p => p.x)) + Math.max(...corners.map(p => p.x))) / 2, y: (Math.min(...corners.map(p => p.y)) + Math.max(...corners.map(p => p.y))) / 2 };
      const alone = this.lattice.repeat === 'none';
      if (!this.placed || again || alone) {
        const top = 76 * d, tall = UNIT * (this.lattice.hexagonal ? 1 : this.lattice.aspect);
        this.camera.z = alone ? 0.9 * Math.min(room.width / UNIT, (room.height - top) / tall) : Math.min(room.width, room.height) / SHOWN_CELLS / UNIT;
        this.camera.x = room.width / 2 - middle.x * this.camera.z;
        this.camera.y = (alone ? top + (room.height - top) / 2 : room.height / 2) - middle.y * this.camera.z;
      }
      this.fitted = this.lattice.repeat;
      this.placed = !!this.cell;
    }
    this.draw();
  }

  // --- drawing
  draw() {
    if (this.due || this.gone) return;
    this.due = true;
    requestAnimationFrame(() => { this.due = false; if (!this.gone) this.paint(); });
  }

  paint() {
    if (this.fresh) this.refresh();
    if (!this.cell || !this.lattice) return;
    const { camera, pen } = this, d = devicePixelRatio;
    if (this.share === 1 && 2 ** Math.ceil(Math.log2(Math.min(2048, this.needed))) > this.cell.side) this.sharpen();
    this.pattern.draw(this.cell, this.colours, camera);
    pen.resetTransform();
    pen.clearRect(0, 0, this.over.width, this.over.height);
    pen.fillStyle = '#00000001'; // Chromium goes on showing what was on a canvas that is cleared and empty
    pen.fillRect(0, 0, 1, 1);
    pen.setTransform(camera.z, 0, 0, camera.z, camera.x, camera.y);
    pen.lineCap = pen.lineJoin = 'round';
    if (this.spots) this.paintSpots(pen, d / camera.z);
    this.paintStroke(pen, d / camera.z);
  }

  // Prints the cell finer, once the view rests.
  sharpen() {
    clearTimeout(this.sharper);
    this.sharper = setTimeout(() => {
      if (this.gone || this.share < 1) return;
      this.pattern.again(this.cell, this.needed);
      this.draw();
    }, 160);
  }

  // All copies of the sources and sinks that the screen shows, of one ink or of all.
  *copies() {
    const { camera, lattice, state } = this, from = camera.toCanvas(0, 0), to = camera.toCanvas(innerWidth, innerHeight);
    const cells = [...lattice.cells(from, to)];
    const layers = state.layers.map((layer, k) => [layer, k]).filter(([, k]) => this.ink === null || this.ink === k);
    const count = layers.reduce((sum, [layer]) => sum + layer.sources.length + layer.sinks.length, 0);
    const shown = cells.length * count * lattice.operations.length > MOST_DRAWN ? [[0, 0]] : cells;
    for (const [layer, k] of layers) {
      for (const role of ['sources', 'sinks']) {
        for (const [index, spot] of layer[role].entries()) {
          for (const operation of lattice.operations) {
            const place = lattice.repeat === 'none' ? spot : lattice.apply(operation, spot);
            for (const [row, column] of shown) yield { ...lattice.toCanvas(lattice.copy(place, row, column)), layer: k, role, index, operation };
          }
        }
      }
    }
  }

  paintSpots(pen, px) {
    const { lattice, camera } = this, from = camera.toCanvas(0, 0), to = camera.toCanvas(innerWidth, innerHeight);
    pen.lineWidth = 1 * px;
    pen.setLineDash([5 * px, 5 * px]);
    for (const style of ['#ffffffb0', '#00000090']) {
      pen.strokeStyle = style;
      pen.lineDashOffset = style === '#ffffffb0' ? 0 : 5 * px;
      pen.beginPath();
      const corners = lattice.corners(0, 0);
      corners.forEach(({ x, y }, k) => (k ? pen.lineTo(x, y) : pen.moveTo(x, y)));
      pen.closePath();
      pen.stroke();
    }
    pen.setLineDash([]);
    for (const wall of this.state.walls) {
      for (const operation of lattice.operations) {
        for (const [row, column] of lattice.cells(from, to)) {
          const places = wall.points.map(point => lattice.toCanvas(lattice.copy(lattice.repeat === 'none' ? point : lattice.apply(operation, point), row, column)));
          this.line(pen, places, 2 * wall.radius * UNIT, '#7a808a90');
        }
      }
    }
    for (const spot of this.copies()) {
      const colour = `rgb(${this.colours.inks[spot.layer].map(c => Math.round(255 * c)).join()})`, r = (spot.role === 'sources' ? 5 : 4.5) * px;
      pen.beginPath();
      if (spot.role === 'sources') pen.arc(spot.x, spot.y, r, 0, 7); else pen.rect(spot.x - r, spot.y - r, 2 * r, 2 * r);
      pen.fillStyle = spot.role === 'sources' ? '#fff' : '#16181c';
      pen.fill();
      pen.lineWidth = 2.5 * px;
      pen.strokeStyle = colour;
      pen.stroke();
      pen.lineWidth = px;
      pen.strokeStyle = spot.role === 'sources' ? '#000000a0' : '#ffffffc0';
      pen.stroke();
    }
  }

  paintStroke(pen, px) {
    const { stroke, tool, pointer } = this;
    if (stroke && stroke.kind in ROLES) {
      for (const { x, y } of spaced(stroke.points)) {
        pen.beginPath();
        pen.arc(x, y, 6 * px, 0, 7);
        pen.fillStyle = stroke.kind === 'source' ? '#fff' : '#16181c';
        pen.fill();
        pen.lineWidth = px;
        pen.strokeStyle = '#888';
        pen.stroke();
      }
    } else if (stroke?.kind === 'wall' || stroke?.kind === 'erase') this.line(pen, stroke.points, 2 * this.radius, stroke.kind === 'wall' ? '#7a808ac0' : '#ffffff90');
    if (!pointer || tool === 'hand') return;
    const r = tool === 'wall' || tool === 'erase' ? this.radius : 6 * px;
    for (const [style, width] of [['#000000a0', 3], ['#ffffff', 1.5]]) {
      pen.beginPath();
      pen.arc(pointer.x, pointer.y, r, 0, 7);
      pen.strokeStyle = style;
      pen.lineWidth = width * px;
      pen.stroke();
    }
  }

  line(pen, points, width, style) {
    pen.strokeStyle = style;
    pen.lineWidth = width;
    pen.beginPath();
    points.forEach(({ x, y }, k) => {
      const last = points[k - 1];
      if (last && Math.hypot(x - last.x, y - last.y) < UNIT / 2) pen.lineTo(x, y); else { pen.moveTo(x, y); pen.lineTo(x, y); }
    });
    pen.stroke();
  }
}

const rounded = point => point.map(value => Math.min(1, Math.max(0, Math.round(value * 1e4) / 1e4)));

// Returns places along a line, as far apart as sources and sinks may lie.
function spaced(points) {
  const found = [points[0]];
  for (const point of points) {
    for (;;) {
      const last = found.at(-1), far = Math.hypot(point.x - last.x, point.y - last.y);
      if (far < APART * UNIT || found.length >= MOST_SPOTS) break;
      const t = APART * UNIT / far;
      found.push({ x: last.x + t * (point.x - last.x), y: last.y + t * (point.y - last.y) });
    }
  }
  return found;
}
