// Pictures as loose prints, until they have a place and slide there.
import { make, word } from './words.js';

export class Prints {
  constructor(shell, names) {
    this.shell = shell;
    this.names = names;
    this.images = new Map();
    this.table = make('div', { className: 'table' });
    this.bar = make('progress', { max: 1, value: 0, 'aria-label': word('placing') });
    this.text = make('p', {}, word('placing'));
    this.foot = make('div', { className: 'foot' }, this.text, this.bar);
    this.element = make('section', { id: 'prints' }, this.table, this.foot);
    shell.stage.append(this.element);
    names.forEach((name, k) => {
      const frame = make('figure', { title: name, 'aria-label': name }, make('figcaption', {}, name));
      frame.style.setProperty('--turn', `${((k * 37) % 5) - 2}deg`);
      this.table.append(frame);
      this.images.set(k, frame);
    });
    this.table.style.setProperty('--columns', Math.max(1, Math.min(names.length, Math.ceil(Math.sqrt(1.6 * names.length)))));
  }

  async add(number, size, block) {
    const frame = this.images.get(number);
    if (!frame) return;
    const image = make('img', { alt: '', src: URL.createObjectURL(new Blob([block])) });
    await image.decode().catch(() => {});
    frame.prepend(image);
  }

  placing(share) { this.bar.value = share; }

  refuse(text) {
    this.text.textContent = text;
    this.text.setAttribute('role', 'alert');
    this.bar.remove();
    this.foot.classList.add('refused');
    this.foot.append(make('button', { className: 'accent', onclick: () => this.shell.send({ kind: 'start' }) }, word('choose_others')));
  }

  // Lets each print slide to its place on the canvas.
  async slide(seams) {
    const calm = matchMedia('(prefers-reduced-motion: reduce)').matches;
    const moves = [];
    this.foot.remove();
    this.names.forEach((name, k) => {
      const frame = this.images.get(k);
      const image = frame.querySelector('img');
      const target = seams.rectOf(name);
      if (calm || !image || !target) { frame.remove(); return; }
      const from = image.getBoundingClientRect();
      image.style.cssText = `position:fixed;left:${from.left}px;top:${from.top}px;width:${from.width}px;height:${from.height}px`;
      this.element.append(image);
      const to = `translate(${target.x - from.left}px, ${target.y - from.top}px) scale(${target.width / from.width}, ${target.height / from.height})`;
      image.style.transformOrigin = '0 0';
      moves.push(image.animate([{ transform: 'none' }, { transform: to }], { duration: 600, easing: 'cubic-bezier(.3,.1,.2,1)', fill: 'forwards' }).finished);
    });
    this.table.remove();
    await Promise.race([Promise.all(moves), new Promise(done => setTimeout(done, 1500))]);
    seams.show();
    const fading = this.element.animate([{ opacity: 1 }, { opacity: 0 }], { duration: calm ? 0 : 250 });
    fading.finished.then(() => this.remove());
  }

  remove() { this.element.remove(); }
}
