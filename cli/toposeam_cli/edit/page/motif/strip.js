// The strip below: the motif in other colours, and relatives of it.
import { make, word } from '../words.js';
import { icon } from '../icons.js';

const WIDTH = 96, HEIGHT = 64, CELLS = 1.6, LATER_MS = 180;

export class Strip {
  constructor(motif) {
    this.motif = motif;
    this.element = make('nav', { className: 'bar', id: 'strip', 'aria-label': word('colourways') });
    this.ways = motif.offer.palettes.map(palette => {
      const canvas = make('canvas', { width: WIDTH, height: HEIGHT }), name = word(`palette_${palette.name}`);
      return { palette, canvas, button: make('button', { title: name, 'aria-label': name, onclick: () => this.take(palette) }, canvas) };
    });
    this.colours();
  }

  colours() {
    this.bred = null;
    this.element.setAttribute('aria-label', word('colourways'));
    this.element.replaceChildren(...this.ways.map(way => way.button));
    this.later();
  }

  take({ paper, inks }) {
    this.motif.recolour({ paper, inks: inks.slice(0, this.motif.state.layers.length) }, true);
    this.mark();
  }

  later() {
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.paint(), LATER_MS);
  }

  paint() {
    const { motif } = this;
    if (motif.gone || motif.share < 1) return;
    if (!motif.cell || motif.fresh) { this.later(); return; }
    if (this.bred) return;
    for (const { palette, canvas } of this.ways) motif.pattern.thumb(motif.cell, { ...palette, opaque: motif.colours.opaque }, canvas, CELLS);
    this.mark();
    motif.draw();
  }

  mark() {
    const { inks } = this.motif.colours, same = (a, b) => a.every((value, k) => Math.abs(value - b[k]) < 2e-3);
    for (const { palette, button } of this.ways) button.classList.toggle('painting', inks.every((ink, k) => same(ink, palette.inks[k])));
  }

  // --- relatives
  relatives(count) {
    this.element.setAttribute('aria-label', word('relatives'));
    this.bred = Array.from({ length: count }, (_, k) => {
      const canvas = make('canvas', { width: WIDTH, height: HEIGHT }), name = word('relative', k + 1);
      return { canvas, button: make('button', { className: 'relative', title: name, 'aria-label': name, disabled: true, onclick: () => this.choose(k) }, canvas) };
    });
    const close = make('button', { className: 'plain', id: 'colours-shown', title: word('colourways'), 'aria-label': word('colourways'), onclick: () => this.colours() }, icon('close'));
    this.element.replaceChildren(...this.bred.map(one => one.button), close);
  }

  relative(head, blocks) {
    const one = this.bred?.[head.number], { motif } = this;
    if (!one) return;
    const lattice = head.repeat === motif.lattice.repeat ? motif.lattice : null;
    if (!lattice) return;
    this.scratch = motif.pattern.printed(head, blocks, lattice, motif.state.layers.map(layer => layer.edge), 256, this.scratch);
    motif.pattern.thumb(this.scratch, motif.colours, one.canvas, CELLS);
    one.button.disabled = false;
    motif.draw();
  }

  choose(k) {
    this.bred.forEach((one, n) => one.button.classList.toggle('painting', n === k));
    this.motif.send({ kind: 'relative', number: k });
  }
}
