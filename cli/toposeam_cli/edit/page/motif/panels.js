// What stands beside the motif: style, rule, inks and sliders; and, under more, how it is saved.
import { icon } from '../icons.js';
import { languageChoice, make, word } from '../words.js';

const FORMATS = ['png', 'svg', 'pdf', 'tif', 'toml', 'webp', 'mp4', 'growing.svg'], PERIOD_MS = 50;
const GROWTHS = { webp: 'WebP', mp4: 'MP4', 'growing.svg': 'SVG' };

const hex = colour => `#${colour.map(c => Math.round(255 * c).toString(16).padStart(2, '0')).join('')}`;
const colour = text => [1, 3, 5].map(k => Number.parseInt(text.slice(k, k + 2), 16) / 255);

export class MotifPanels {
  constructor(motif) {
    Object.assign(this, { motif, locks: { style: false, rule: false } });
    this.element = make('aside', { className: 'bar', id: 'design', 'aria-label': word('motif') });
    this.more = make('aside', { className: 'bar', id: 'more', hidden: true, 'aria-label': word('more') });
    this.build();
  }

  toggle(name) {
    const panel = this[name];
    if (name === 'element') {
      const open = panel.classList.toggle(innerWidth <= 760 ? 'open' : 'shut');
      document.getElementById('list-shown').setAttribute('aria-expanded', innerWidth <= 760 ? open : !open);
      return;
    }
    panel.hidden = !panel.hidden;
    document.getElementById('more-shown').setAttribute('aria-expanded', !panel.hidden);
    if (!panel.hidden) panel.querySelector('select, input')?.focus();
  }

  hide(name) {
    if (name === 'more' && !this.more.hidden) this.toggle('more');
    if (innerWidth <= 760) this.element.classList.remove('open');
  }

  under() {}

  get locked() {
    const { state } = this.motif;
    return { styles: this.locks.style ? state.layers[0].style : null, repeat: this.locks.rule ? state.repeat : null };
  }

  get saving() {
    return { columns: +this.columns.value, rows: +this.rows.value, px: +this.px.value };
  }

  build() {
    const { motif } = this, { offer } = motif;
    this.style = make('select', { id: 'style', 'aria-label': word('style'), onchange: () => motif.send({ kind: 'style', style: this.style.value, layer: motif.ink }) }, ...offer.styles.map(value => make('option', { value }, word(`style_${value}`))));
    this.rule = make('select', { id: 'rule', 'aria-label': word('rule'), onchange: () => motif.send({ kind: 'repeat', repeat: this.rule.value }) }, ...offer.rules.map(value => make('option', { value }, word(`rule_${value}`))));
    this.inks = make('div', { className: 'inks', role: 'radiogroup', 'aria-label': word('inks') });
    this.sliders = Object.entries(offer.sliders).map(([name, [min, max]]) => this.slider(name, min, max));
    this.opaque = make('input', { type: 'checkbox', id: 'opaque', onchange: () => motif.recolour({ opaque: this.opaque.checked }, true) });
    this.paper = make('input', { type: 'color', id: 'paper', 'aria-label': word('paper') });
    this.paper.oninput = () => motif.recolour({ paper: colour(this.paper.value) }, false);
    this.paper.onchange = () => motif.recolour({ paper: colour(this.paper.value) }, true);
    this.state = make('p', { id: 'status', role: 'status' });
    this.bar = make('progress', { max: 1, value: 0, 'aria-hidden': 'true' });
    this.element.replaceChildren(
      make('div', { className: 'field' }, make('span', {}, word('style')), this.style, this.lock('style')),
      make('div', { className: 'field' }, make('span', {}, word('rule')), this.rule, this.lock('rule')),
      this.inks,
      ...this.sliders.map(one => one.row),
      make('div', { className: 'row-of-two' }, make('label', { className: 'check' }, this.opaque, make('span', {}, word('opaque'))), make('label', { className: 'check' }, this.paper, make('span', {}, word('paper')))),
      make('div', { className: 'rest' }, this.bar, this.state),
    );
    this.format = this.select('format', motif.shell.output ? [] : FORMATS, value => value === 'toml' ? word('recipe') : value in GROWTHS ? word('growth', GROWTHS[value]) : value.toUpperCase(), value => { motif.shell.format = value; });
    const count = (id, value, max) => make('input', { type: 'number', id, min: 1, max, value, step: 1, onchange: event => { event.target.value = Math.min(max, Math.max(+event.target.min, Math.round(+event.target.value) || value)); } });
    [this.columns, this.rows, this.px] = [count('columns', 1, 32), count('rows', 1, 32), count('px', 1024, 8192)];
    this.px.min = 16;
    const field = (name, input) => make('label', {}, make('span', {}, word(name)), input);
    const finish = make('button', { id: 'finish', title: `${word('finish')} (F)`, onclick: () => { this.hide('more'); motif.send({ kind: 'finish' }); } }, word('finish'));
    this.more.replaceChildren(make('h2', {}, word('more')), ...(motif.shell.output ? [] : [this.format]), field('columns', this.columns), field('rows', this.rows), field('px', this.px), finish, languageChoice());
  }

  select(name, values, titled, changed) {
    const select = make('select', { id: `set-${name}`, onchange: () => changed(select.value) }, ...values.map(value => make('option', { value }, titled(value))));
    return make('label', {}, make('span', {}, word(name)), select);
  }

  lock(name) {
    const button = make('button', { id: `lock-${name}`, className: 'plain', 'aria-pressed': 'false', title: word(`lock_${name}`), 'aria-label': word(`lock_${name}`) }, icon('unlocked'));
    button.onclick = () => {
      this.locks[name] = !this.locks[name];
      button.setAttribute('aria-pressed', this.locks[name]);
      button.replaceChildren(icon(this.locks[name] ? 'locked' : 'unlocked'));
    };
    return button;
  }

  slider(name, min, max) {
    const { motif } = this;
    const input = make('input', { type: 'range', id: name, min, max, step: (max - min) / 100 });
    const tell = done => motif.send({ kind: 'set', name, value: +input.value, layer: motif.ink, done });
    input.oninput = () => {
      const now = performance.now();
      input.dataset.held = '1';
      if (now - (this.told ?? 0) < PERIOD_MS) return;
      this.told = now;
      tell(false);
    };
    input.onchange = () => { delete input.dataset.held; tell(true); };
    return { name, input, row: make('label', { className: 'slide' }, make('span', {}, word(name)), input) };
  }

  // Shows what the server says of the motif.
  show() {
    const { motif } = this, { state } = motif;
    if (!state) return;
    const layers = motif.ink === null ? state.layers : [state.layers[motif.ink]];
    const style = layers.every(layer => layer.style === layers[0].style) ? layers[0].style : null;
    this.style.querySelector('[value=""]')?.remove();
    if (!style) this.style.prepend(make('option', { value: '', disabled: true }, word('mixed')));
    this.style.value = style ?? '';
    this.rule.querySelector('.own')?.remove();
    if (!motif.offer.rules.includes(state.repeat)) this.rule.append(make('option', { value: state.repeat, className: 'own' }, state.repeat));
    this.rule.value = state.repeat;
    for (const { name, input } of this.sliders) if (!input.dataset.held) input.value = layers.reduce((sum, layer) => sum + layer[name], 0) / layers.length;
    this.opaque.checked = state.inking === 'opaque';
    if (document.activeElement !== this.paper) this.paper.value = hex(state.paper);
    this.showInks(state);
  }

  showInks(state) {
    const { motif } = this, count = state.layers.length;
    if (this.inks.childElementCount === 0 || this.shown !== count) {
      this.shown = count;
      const all = make('button', { role: 'radio', id: 'ink-all', onclick: () => motif.pick(null) }, word('all_inks'));
      const own = state.layers.map((_, k) => {
        const input = make('input', { type: 'color', id: `colour-${k + 1}`, 'aria-label': word('ink_colour', k + 1), title: word('ink_colour', k + 1) });
        const change = done => () => motif.recolour({ inks: motif.colours.inks.map((ink, n) => n === k ? colour(input.value) : ink) }, done);
        input.oninput = change(false);
        input.onchange = change(true);
        return make('span', { className: 'ink' }, make('button', { role: 'radio', id: `ink-${k + 1}`, 'aria-label': word('ink', k + 1), title: `${word('ink', k + 1)} (${k + 1})`, onclick: () => motif.pick(k) }, k + 1), input);
      });
      const step = (id, by, sign) => make('button', { id, title: word(id.replace('-', '_')), 'aria-label': word(id.replace('-', '_')), disabled: count + by < 1 || count + by > motif.offer.most, onclick: () => motif.send({ kind: 'layers', count: count + by }) }, sign);
      this.inks.replaceChildren(all, ...own, step('fewer-inks', -1, '−'), step('more-inks', 1, '+'));
    }
    document.getElementById('ink-all')?.setAttribute('aria-checked', motif.ink === null);
    state.layers.forEach((layer, k) => {
      this.inks.querySelector(`#ink-${k + 1}`).setAttribute('aria-checked', motif.ink === k);
      const input = this.inks.querySelector(`#colour-${k + 1}`);
      if (document.activeElement !== input) input.value = hex(motif.colours.inks[k]);
    });
    this.inks.querySelector('#ink-all').setAttribute('aria-checked', motif.ink === null);
  }

  status() {
    const { motif } = this, text = motif.share < 1 ? word('growing') : word(motif.final ? 'finished' : 'sketched');
    this.bar.value = motif.share;
    this.bar.hidden = motif.share === 1;
    if (this.state.textContent !== text) this.state.textContent = text;
    this.element.classList.toggle('final', motif.final);
  }

  finishing(share) {
    if (!share) { this.status(); return; }
    this.bar.hidden = false;
    this.bar.value = share;
    this.state.textContent = word('finishing', Math.round(100 * share));
  }
}
