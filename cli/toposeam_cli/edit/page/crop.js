// The crop on the picture: a box with eight handles, which are buttons, so that touch and keys move them, too.
// A whole turn keeps its width: it has two.
import { make, word } from './words.js';

const LEAST = 8; // px of the canvas
const HANDLES = [['left'], ['right'], ['top'], ['bottom'], ['left', 'top'], ['right', 'top'], ['left', 'bottom'], ['right', 'bottom']];

export class Crop {
  constructor(seams, box) {
    this.seams = seams;
    this.sides = seams.scene.round ? HANDLES.filter(([side, more]) => !more && (side === 'top' || side === 'bottom')) : HANDLES;
    this.handles = this.sides.map(sides => {
      const name = sides.map(side => word(`crop_${side}`)).join(', ');
      const handle = make('button', { className: `handle ${sides.join(' ')}`, hidden: true, title: name, 'aria-label': name });
      handle.onpointerdown = event => { if (seams.shell.owner) handle.setPointerCapture(event.pointerId); event.stopPropagation(); };
      handle.onpointermove = event => { if (handle.hasPointerCapture(event.pointerId)) this.drag(sides, seams.camera.toCanvas(event.clientX, event.clientY)); };
      handle.onpointerup = () => this.send();
      handle.onkeydown = event => this.key(event, sides);
      return handle;
    });
    this.show(box);
  }

  show(box) {
    if (this.changed) return; // it is being moved, and what comes is older
    this.box = box && { left: box[0], top: box[1], right: box[0] + box[2], bottom: box[1] + box[3] };
    for (const handle of this.handles) handle.hidden = !box;
    this.seams.draw();
  }

  drag(sides, at) {
    const { box } = this, { width, height } = this.seams.picture;
    for (const side of sides) {
      const flat = side === 'left' || side === 'right', most = flat ? width : height;
      const value = Math.min(most, Math.max(0, flat ? at.x : at.y));
      if (side === 'left' || side === 'top') box[side] = Math.min(value, box[flat ? 'right' : 'bottom'] - LEAST);
      else box[side] = Math.max(value, box[flat ? 'left' : 'top'] + LEAST);
    }
    this.changed = true;
    this.seams.draw();
  }

  key(event, sides) {
    const way = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
    if (!way || !this.seams.shell.owner) return;
    event.preventDefault();
    event.stopPropagation();
    const step = event.shiftKey ? 1 : 8, { box } = this;
    const flat = sides.find(side => side === 'left' || side === 'right'), upright = sides.find(side => side === 'top' || side === 'bottom');
    const at = { x: (box[flat] ?? 0) + step * way[0], y: (box[upright] ?? 0) + step * way[1] };
    this.drag(sides, at);
    clearTimeout(this.due);
    this.due = setTimeout(() => this.send(), 200);
  }

  send() {
    if (!this.changed) return;
    this.changed = false;
    const { left, top, right, bottom } = this.box;
    this.seams.shell.send({ kind: 'crop', box: [[left, top], [right - left, bottom - top]] });
  }

  // Dims what is cropped, and moves the handles to where the box is on the screen.
  paint(pen, px) {
    if (!this.box) return;
    const { left, top, right, bottom } = this.box, { camera, picture } = this.seams;
    const path = new Path2D();
    path.rect(0, 0, picture.width, picture.height);
    path.rect(left, top, right - left, bottom - top);
    pen.fillStyle = '#000000a8';
    pen.fill(path, 'evenodd');
    for (const [colour, width] of [['#000000b0', 4], ['#fff', 2]]) {
      pen.strokeStyle = colour;
      pen.lineWidth = width * px;
      pen.strokeRect(left, top, right - left, bottom - top);
    }
    const middle = { x: (left + right) / 2, y: (top + bottom) / 2 };
    this.sides.forEach((sides, k) => {
      const flat = sides.find(side => side === 'left' || side === 'right'), upright = sides.find(side => side === 'top' || side === 'bottom');
      const at = camera.toScreen(flat ? this.box[flat] : middle.x, upright ? this.box[upright] : middle.y);
      Object.assign(this.handles[k].style, { left: `${at.x}px`, top: `${at.y}px` });
    });
  }
}
