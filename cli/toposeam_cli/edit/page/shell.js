// What every page has: the socket, bars, undo, save, what is said, and who owns the work.
import { icon } from './icons.js';
import { make, word } from './words.js';

export class Shell {
  constructor() {
    this.stage = document.getElementById('stage');
    this.owner = false;
    this.handlers = new Map();
    this.parts = [];
    this.saving = false;
    this.format = 'jpg';
    this.on('hello', head => { this.output = head.output; this.own(head.owner); });
    this.on('role', head => this.own(head.owner));
    this.on('failed', head => { this.ended(); this.say(head.text, 'bad'); });
    this.on('told', head => this.say(word(head.word)));
    this.on('state', head => this.steps(head));
    this.on('saving', head => this.progress(head.share));
    this.on('saved', head => this.saved(head));
    this.on('cancelled', () => { this.ended(); this.say(word('save_cancelled')); });
    addEventListener('keydown', event => this.key(event));
  }

  on(kind, handler) {
    this.handlers.set(kind, [...(this.handlers.get(kind) ?? []), handler]);
  }

  // --- the socket
  connect() {
    const address = new URL('live', location.href);
    address.protocol = 'ws:';
    this.socket = new WebSocket(address);
    this.socket.binaryType = 'arraybuffer';
    let chain = Promise.resolve();
    this.socket.onopen = () => this.banner(null);
    this.socket.onmessage = event => { chain = chain.then(() => this.take(event.data)); };
    this.socket.onclose = () => {
      this.ended();
      this.banner(word('server_ended'));
      setTimeout(() => this.connect(), 2000);
    };
  }

  async take(data) {
    const length = new DataView(data).getUint32(0, true);
    const head = JSON.parse(new TextDecoder().decode(new Uint8Array(data, 4, length)));
    const blocks = [];
    let at = 4 + length;
    for (const size of head.sizes) {
      blocks.push(new Uint8Array(data, at, size));
      at += size;
    }
    for (const handler of this.handlers.get(head.kind) ?? []) await handler(head, blocks);
  }

  send(message) {
    if (this.socket?.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify(message));
  }

  own(owner) {
    this.owner = owner;
    document.body.classList.toggle('onlooker', !owner);
    if (owner) this.banner(null);
    else this.banner(word('looks_on'), word('take_over'), () => this.send({ kind: 'takeover' }));
  }

  // --- what is said
  say(text, tone = '') {
    const say = document.getElementById('say');
    say.className = tone;
    say.textContent = text;
    clearTimeout(this.sayTimer);
    if (tone !== 'bad') this.sayTimer = setTimeout(() => { say.textContent = ''; }, 6000);
    else say.append(make('button', { className: 'plain', 'aria-label': word('close'), onclick: () => { say.textContent = ''; } }, icon('close')));
  }

  banner(text, action, act) {
    document.getElementById('banner')?.remove();
    if (!text) return;
    document.body.append(make('div', { id: 'banner', role: 'alert' }, text, action ? make('button', { onclick: act }, action) : null));
  }

  // --- bars: `page` gives its own tools and what the list and the strip hold
  bars(page) {
    for (const part of this.parts) part.remove();
    this.parts = [];
    this.page = page;
    if (!page) return;
    const steps = ['undo', 'redo'].map(name => this.button(name, word(name), () => this.send({ kind: name })));
    [this.undo, this.redo] = steps;
    this.saveButton = make('button', { id: 'save', className: 'accent', onclick: () => this.save() }, icon('save'), make('span', {}, word('save')));
    this.cancelButton = make('button', { id: 'cancel', hidden: true, 'aria-label': word('cancel'), title: word('cancel'), onclick: () => this.send({ kind: 'cancel' }) }, icon('close'));
    const top = make('header', { className: 'bar', id: 'tools', role: 'toolbar', 'aria-label': word('tools') }, ...page.tools());
    const right = make('div', { className: 'bar', id: 'steps', role: 'toolbar', 'aria-label': word('work') }, ...steps, ...page.extras(), this.saveButton, this.cancelButton);
    this.parts = [top, right, ...page.panels()];
    document.body.append(...this.parts);
    this.steps({ undo: 0, redo: 0 });
  }

  button(name, label, act, given = {}) {
    return make('button', { id: name, title: label, 'aria-label': label, onclick: act, ...given }, icon(given.icon ?? name), make('span', {}, label));
  }

  steps(head) {
    if (!this.undo || head.undo == null) return;
    this.undo.disabled = !head.undo;
    this.redo.disabled = !head.redo;
  }

  // --- save
  save() {
    if (!this.page || !this.owner) return;
    if (this.saving) { this.again = true; return; }
    this.saving = true;
    this.again = false;
    this.cancelButton.hidden = false;
    this.progress(0);
    this.send({ kind: 'save', format: this.format, ...this.page.saving?.() });
  }

  progress(share) {
    this.saveButton?.style.setProperty('--share', share);
    this.saveButton?.classList.toggle('busy', this.saving);
    const text = this.saveButton?.querySelector('span');
    if (text) text.textContent = this.saving ? word('saving', Math.round(100 * share)) : word('save');
  }

  ended() {
    this.saving = false;
    if (this.cancelButton) this.cancelButton.hidden = true;
    this.progress(0);
  }

  saved(head) {
    this.ended();
    if (this.again) this.save();
    if (head.download && this.owner) {
      const link = make('a', { href: `saved/${head.download}`, download: head.text });
      link.click();
    }
    this.say(word('saved', head.text), 'good');
  }

  key(event) {
    const key = event.key.toLowerCase();
    if (!(event.ctrlKey || event.metaKey) || !this.page) return;
    if (key === 'z' || key === 'y') this.send({ kind: key === 'y' || event.shiftKey ? 'redo' : 'undo' });
    else if (key === 's') this.save();
    else return;
    event.preventDefault();
  }
}
