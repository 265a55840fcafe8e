// Where the canvas lies on the screen: pan, zoom, and flights between views. In px of the device.
export class Camera {
  constructor(changed) { Object.assign(this, { x: 0, y: 0, z: 1, changed }); }

  fit(width, height, room) {
    this.z = Math.min(room.width / width, room.height / height);
    this.x = room.left + (room.width - width * this.z) / 2;
    this.y = room.top + (room.height - height * this.z) / 2;
    this.changed();
  }

  toCanvas(x, y) { return { x: (x * devicePixelRatio - this.x) / this.z, y: (y * devicePixelRatio - this.y) / this.z }; }
  toScreen(x, y) { return { x: (x * this.z + this.x) / devicePixelRatio, y: (y * this.z + this.y) / devicePixelRatio }; }

  pan(dx, dy) {
    this.x += dx * devicePixelRatio;
    this.y += dy * devicePixelRatio;
    this.changed();
  }

  zoom(factor, x, y) {
    const at = this.toCanvas(x, y);
    this.z = Math.min(40, Math.max(0.03, this.z * factor));
    this.x = x * devicePixelRatio - at.x * this.z;
    this.y = y * devicePixelRatio - at.y * this.z;
    this.changed();
  }

  fly(x, y, z, room) {
    const from = { x: this.x, y: this.y, z: this.z }, start = performance.now();
    const to = { z, x: room.left + room.width / 2 - x * z, y: room.top + room.height / 2 - y * z };
    const calm = matchMedia('(prefers-reduced-motion: reduce)').matches;
    const step = now => {
      const t = calm ? 1 : Math.min(1, (now - start) / 260), e = t * t * (3 - 2 * t);
      for (const axis of 'xyz') this[axis] = from[axis] + (to[axis] - from[axis]) * e;
      this.changed();
      if (t < 1) requestAnimationFrame(step);
    };
    requestAnimationFrame(step);
  }
}
