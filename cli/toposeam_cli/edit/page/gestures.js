// Pointers and keys: press and drag paints, a tap opens the lens, two fingers or the right button move.
const STILL_PX = 5, HOLD_MS = 420, FLICK_PX = 46, STEP_PX = 34;

export class Gestures {
  constructor(seams) {
    this.seams = seams;
    this.fingers = new Map();
    const canvas = this.canvas = seams.over;
    canvas.addEventListener('pointerdown', event => this.down(event));
    canvas.addEventListener('pointermove', event => this.move(event));
    canvas.addEventListener('pointerup', event => this.up(event));
    canvas.addEventListener('pointercancel', event => this.up(event, true));
    canvas.addEventListener('pointerleave', event => { if (event.pointerType === 'mouse' && !this.press) { seams.pointer = null; seams.draw(); } });
    canvas.addEventListener('contextmenu', event => event.preventDefault());
    canvas.addEventListener('wheel', event => this.wheel(event), { passive: false });
    this.keys = [['keydown', event => this.keyDown(event)], ['keyup', event => this.keyUp(event)]];
    for (const [name, handler] of this.keys) addEventListener(name, handler);
  }

  remove() { for (const [name, handler] of this.keys) removeEventListener(name, handler); }

  at(event) { return this.seams.camera.toCanvas(event.clientX, event.clientY); }

  down(event) {
    const { seams } = this;
    this.canvas.setPointerCapture(event.pointerId);
    document.body.classList.remove('keyed');
    this.canvas.focus({ preventScroll: true });
    this.fingers.set(event.pointerId, event);
    seams.panels.hide('more');
    if (this.fingers.size === 2) { this.pinch(); return; }
    if (event.button === 1 || event.button === 2) { this.press = { pans: true, x: event.clientX, y: event.clientY }; return; }
    if (event.button !== 0 || this.fingers.size > 1) return;
    const at = this.at(event);
    this.press = { at, x: event.clientX, y: event.clientY, lensWas: seams.lens?.stays };
    seams.pointer = at;
    // Moves that wait behind a slow drawing come before the lens opens.
    if (seams.tool === 'push') this.holding = setTimeout(() => { this.holding = setTimeout(() => this.hold(at), 30); }, HOLD_MS);
    seams.draw();
  }

  hold(at) {
    const { seams } = this;
    if (this.press && !seams.stroke && seams.openLens(at)) this.press.looks = true;
  }

  pinch() {
    clearTimeout(this.holding);
    this.seams.cancel();
    this.seams.closeLens();
    const [a, b] = this.fingers.values();
    this.press = { pinches: true, x: (a.clientX + b.clientX) / 2, y: (a.clientY + b.clientY) / 2, apart: Math.hypot(a.clientX - b.clientX, a.clientY - b.clientY) };
  }

  move(event) {
    const { seams, press } = this, at = this.at(event);
    if (this.fingers.has(event.pointerId)) this.fingers.set(event.pointerId, event);
    seams.pointer = event.pointerType === 'touch' && !press ? null : at;
    seams.panels.under(seams.picture.at(at.x, at.y));
    if (this.space && !press) { seams.openLens(at); return; }
    if (!press) { seams.draw(); return; }
    if (press.pinches) { this.pinched(); return; }
    const dx = event.clientX - press.x, dy = event.clientY - press.y;
    if (press.pans) { seams.camera.pan(dx, dy); Object.assign(press, { x: event.clientX, y: event.clientY }); return; }
    if (press.looks) { this.look(dx, dy); return; }
    if (!seams.stroke && Math.hypot(dx, dy) > STILL_PX && !press.refused) {
      clearTimeout(this.holding);
      seams.closeLens();
      press.refused = !seams.begin(press.at);
    }
    if (seams.stroke) for (const each of event.getCoalescedEvents?.() ?? [event]) seams.extend(this.at(each));
    seams.draw();
  }

  // While the lens is held, a move to the side chooses the picture, and a flick up takes the thing. Of two
  // pictures there is nothing to choose, and such a move paints.
  look(dx, dy) {
    const { seams, press } = this;
    press.flicked = dy < -FLICK_PX && Math.abs(dx) < -dy;
    if (seams.lens?.others.length === 1 && (Math.abs(dx) > 3 * STILL_PX || dy > 3 * STILL_PX) && !press.flicked) {
      press.looks = false;
      seams.closeLens();
      press.refused = !seams.begin(press.at);
      return;
    }
    const step = Math.round(dx / STEP_PX);
    if (step !== (press.step ?? 0)) { seams.turnLens(step - (press.step ?? 0)); press.step = step; }
  }

  pinched() {
    const { seams, press } = this;
    if (this.fingers.size < 2) return;
    const [a, b] = this.fingers.values(), x = (a.clientX + b.clientX) / 2, y = (a.clientY + b.clientY) / 2;
    const apart = Math.hypot(a.clientX - b.clientX, a.clientY - b.clientY);
    seams.camera.pan(x - press.x, y - press.y);
    seams.camera.zoom(apart / press.apart, x, y);
    Object.assign(press, { x, y, apart });
  }

  up(event, cancelled = false) {
    const { seams, press } = this;
    this.fingers.delete(event.pointerId);
    clearTimeout(this.holding);
    if (!press) return;
    if (press.pinches && this.fingers.size) return;
    this.press = null;
    if (seams.stroke) { if (cancelled) seams.cancel(); else seams.end(); }
    else if (press.looks) { if (press.flicked) seams.takeThing(); else seams.closeLens(); }
    else if (press.at && !cancelled && !press.refused) {
      if (press.lensWas) seams.closeLens();
      else if (seams.tool === 'push') seams.openLens(press.at, true);
      else if (seams.begin(press.at)) seams.end();
    }
    if (event.pointerType === 'touch') seams.pointer = null;
    seams.draw();
  }

  wheel(event) {
    event.preventDefault();
    if (event.altKey) this.seams.resize(this.seams.radius * Math.exp(-event.deltaY * 0.002));
    else if (event.shiftKey) this.seams.camera.pan(-event.deltaY, -event.deltaX);
    else this.seams.camera.zoom(Math.exp(-event.deltaY * (event.ctrlKey ? 0.01 : 0.0015)), event.clientX, event.clientY);
  }

  // --- keys: arrows move the brush, Enter presses and lets go, Space is the lens
  keyDown(event) {
    if (/^(Tab|Arrow|Enter)/.test(event.key)) document.body.classList.add('keyed');
    const { seams } = this, onCanvas = document.activeElement === this.canvas || document.activeElement === document.body;
    if (event.key === 'Escape') { seams.cancel(); seams.closeLens(); seams.panels.hide('more'); return; }
    if (onCanvas && this.arrows(event)) { event.preventDefault(); return; }
    if (onCanvas && event.key === ' ') {
      event.preventDefault();
      if (!event.repeat) { this.space = true; seams.openLens(seams.pointer ?? this.middle()); }
      return;
    }
    if (onCanvas && event.key === 'Enter') { event.preventDefault(); if (!event.repeat) this.enter(); return; }
    if (onCanvas && event.key.toLowerCase() === 't') { seams.takeThing(); return; }
    if (seams.key(event)) event.preventDefault();
  }

  keyUp(event) {
    if (event.key === ' ' && this.space) { this.space = false; if (!this.seams.lens?.stays) this.seams.closeLens(); }
    if (event.key.toLowerCase() === 'a') this.seams.showBefore(false);
  }

  middle() { return this.seams.camera.toCanvas(innerWidth / 2, innerHeight / 2); }

  arrows(event) {
    const way = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
    if (!way) return false;
    const { seams } = this;
    if (seams.lens && (this.space || seams.lens.stays) && way[0]) { seams.turnLens(way[0]); return true; }
    const step = event.shiftKey ? 1 : Math.max(4, seams.radius / 2), from = seams.pointer ?? this.middle();
    seams.pointer = { x: from.x + way[0] * step, y: from.y + way[1] * step };
    if (seams.stroke) seams.extend(seams.pointer);
    seams.panels.under(seams.picture.at(seams.pointer.x, seams.pointer.y));
    seams.draw();
    return true;
  }

  enter() {
    const { seams } = this;
    if (seams.lens) seams.takeThing();
    else if (seams.stroke) seams.end();
    else {
      seams.pointer ??= this.middle();
      seams.begin(seams.pointer);
      seams.draw();
    }
  }
}
