// What stands round the picture: the strip of pictures, the worst places, the lens's name, and more settings.
import { icon } from './icons.js';
import { colourOf } from './lines.js';
import { languageChoice, make, word } from './words.js';

const THUMB = 72;
const SETTINGS = {
  model: ['auto', 'shift', 'similarity', 'plane', 'rotation'],
  projection: ['auto', 'flat', 'cylinder', 'sphere', 'panini'],
  level: ['yes', 'no'],
  blend: ['auto', 'multiband', 'feather', 'soft', 'gradient', 'none'],
  tones: ['auto', 'shading', 'gains', 'none'],
  crop: ['auto', 'fit', 'inside', 'outside', 'box'],
};

const PLACING = ['model', 'projection', 'level'];

export class Panels {
  constructor(seams) {
    this.seams = seams;
    this.stripElement = make('nav', { className: 'bar', id: 'strip', role: 'radiogroup', 'aria-label': word('paint_with') });
    this.rows = make('ol', {});
    this.places = make('aside', { className: 'bar', id: 'places', 'aria-label': word('look_here') }, make('h2', {}, word('look_here')), this.rows);
    this.more = make('aside', { className: 'bar', id: 'more', hidden: true, 'aria-label': word('more') });
    this.chip = make('div', { className: 'bar', id: 'chip', hidden: true });
    this.settings();
    this.at = -1;
  }

  elements() { return [this.stripElement, this.places, this.more, this.chip]; }

  toggle(name) {
    const panel = this[name], narrow = innerWidth <= 760;
    if (name === 'places') {
      panel.classList.toggle(narrow ? 'open' : 'shut');
      if (!narrow) this.seams.fit();
    } else {
      panel.hidden = !panel.hidden;
      document.getElementById('more-shown').setAttribute('aria-expanded', !panel.hidden);
      if (!panel.hidden) panel.querySelector('select')?.focus();
    }
  }

  hide(name) {
    if (name === 'more' && !this.more.hidden) this.toggle('more');
  }

  // --- the strip
  strip(blocks) {
    const { layers } = this.seams.scene;
    this.buttons = layers.map((layer, k) => {
      const image = make('img', { alt: '', src: URL.createObjectURL(new Blob([blocks[k]], { type: 'image/webp' })) });
      const button = make('button', { role: 'radio', 'aria-checked': 'false', title: layer.name, 'aria-label': `${k + 1}: ${layer.name}`, onclick: () => this.seams.pick(k) }, image, make('b', {}, k + 1));
      const tint = on => () => { this.seams.tint = on ? k : -1; this.seams.draw(); };
      button.onpointerenter = tint(true);
      button.onpointerleave = tint(false);
      return button;
    });
    this.stripElement.replaceChildren(...this.buttons);
  }

  picked(chosen, painting = null) {
    this.buttons?.forEach((button, k) => {
      button.setAttribute('aria-checked', k === chosen);
      button.classList.toggle('painting', k === painting);
    });
  }

  under(k) {
    if (k === this.wasUnder) return;
    this.wasUnder = k;
    this.buttons?.forEach((button, n) => button.classList.toggle('under', n === k));
  }

  // --- the worst places
  list() {
    const { places } = this.seams;
    const open = places.filter(place => !place.done).length;
    document.getElementById('list-shown')?.setAttribute('data-count', open || '✓');
    this.places.classList.toggle('empty', !places.length);
    if (!places.length) {
      this.rows.replaceChildren(make('li', { className: 'none' }, icon('tick'), word('nothing_shows')));
      return;
    }
    this.rows.replaceChildren(...places.map((place, k) => this.row(place, k)));
  }

  row(place, k) {
    const thumb = make('canvas', { width: THUMB, height: THUMB });
    const { image } = this.seams.picture.part(place.x, place.y, Math.min(THUMB, this.seams.picture.width), Math.min(THUMB, this.seams.picture.height));
    thumb.getContext('2d').putImageData(image, 0, 0);
    const name = word(place.done ? 'place_done' : 'place', k + 1);
    const look = make('button', { className: 'look', 'aria-label': name, title: name, 'aria-current': k === this.at, onclick: () => this.go(k) }, thumb, place.done ? make('i', { className: 'tick' }, icon('tick')) : null);
    look.style.setProperty('--mark', colourOf(place.likeness));
    const other = make('button', { className: 'other', title: word('other_way'), 'aria-label': word('other_way'), onclick: () => { this.at = k; this.seams.otherWay(place); } }, icon('other'), make('span', {}, word('other_way')));
    return make('li', { className: place.done ? 'done' : '' }, look, place.done ? make('small', {}, word('no_longer_shows')) : other);
  }

  go(k) {
    const place = this.seams.places[k];
    if (!place) return;
    this.at = k;
    this.places.classList.remove('open');
    this.seams.goTo(place);
    [...this.rows.querySelectorAll('.look')].forEach((button, n) => button.setAttribute('aria-current', n === k));
  }

  step(way) {
    const count = this.seams.places.length;
    if (count) this.go((this.at + way + count) % count);
  }

  otherWay() {
    const place = this.seams.places[this.at];
    if (place) this.seams.otherWay(place);
  }

  // --- the lens
  lens(lens) {
    this.chip.hidden = !lens?.stays;
    if (!lens?.stays) return;
    const { seams } = this, at = seams.camera.toScreen(lens.x, lens.y + seams.lensRadius);
    const name = seams.scene.layers[lens.layer].name;
    this.chip.replaceChildren(...[
      make('span', { className: 'name' }, name),
      lens.others.length > 1 ? make('button', { title: word('next_picture'), 'aria-label': word('next_picture'), onclick: () => seams.turnLens(1) }, icon('redo')) : null,
      make('button', { className: 'accent', title: `${word('take_help')} (T)`, onclick: () => seams.takeThing() }, word('take')),
    ].filter(Boolean));
    this.chip.style.left = `${Math.min(innerWidth - 130, Math.max(130, at.x))}px`;
    this.chip.style.top = `${Math.min(innerHeight - 70, at.y + 8)}px`;
  }

  // --- more
  settings() {
    const { seams } = this, chosen = { ...seams.scene.settings, ...(seams.scene.crop && { crop: 'box' }) };
    const rows = Object.entries(SETTINGS).filter(([name]) => !(seams.scene.placed && PLACING.includes(name))).map(([name, values]) => this.select(name, values, chosen[name] ?? values[0], value => `${name}_${value}`, () => this.apply()));
    const format = seams.shell.output ? null : this.select('format', ['jpg', 'png', 'tif', 'webp'], seams.shell.format, value => value.toUpperCase(), value => { seams.shell.format = value; });
    const horizon = make('button', { id: 'horizon', title: word('horizon_help'), onclick: () => { this.hide('more'); seams.choose('horizon'); seams.shell.say(word('horizon_help')); } }, word('horizon'));
    const others = make('button', { onclick: () => seams.shell.send({ kind: 'start' }) }, word('choose_others'));
    this.more.replaceChildren(make('h2', {}, word('more')), ...rows, horizon, ...(format ? [format] : []), languageChoice(), others);
  }

  select(name, values, chosen, titled, changed) {
    const options = values.map(value => make('option', { value, selected: value === chosen }, word(titled(value))));
    const select = make('select', { id: `set-${name}`, onchange: () => changed(select.value) }, ...options);
    return make('label', {}, make('span', {}, word(name)), select);
  }

  apply() {
    const settings = {};
    for (const [name, values] of Object.entries(SETTINGS)) {
      const select = document.getElementById(`set-${name}`);
      if (select && select.value !== values[0]) settings[name] = select.value;
    }
    this.seams.shell.send({ kind: 'settings', settings });
    this.seams.shell.say(word('again'));
  }
}
