// The first page: photographs to drop, samples, and what was edited last.
import { make, word } from './words.js';
import { icon } from './icons.js';

const count = new Intl.NumberFormat();

export function showDrop(shell, head) {
  document.getElementById('drop')?.remove();
  const input = make('input', { type: 'file', multiple: true, accept: 'image/*,.tif,.tiff,.heic', id: 'files', className: 'unseen', onchange: () => open(shell, input.files) });
  const target = make('label', { className: 'target', htmlFor: 'files' }, input, icon('save'), make('h1', {}, word('drop_here')), make('p', {}, word('or_choose')));
  const page = make('section', { id: 'drop' }, make('p', { className: 'brand' }, 'TopoSeam'), target, samples(shell, head.samples), recent(shell, head.recent));
  const over = on => event => { event.preventDefault(); target.classList.toggle('over', on); };
  page.addEventListener('dragover', over(true));
  page.addEventListener('dragleave', over(false));
  page.addEventListener('drop', event => { over(false)(event); open(shell, event.dataTransfer.files); });
  shell.stage.append(page);
}

function samples(shell, names) {
  if (!names.length) return null;
  const titles = ['sample_portrait', 'sample_coffee'];
  const buttons = names.map((own, k) => make('button', { className: 'card', onclick: () => shell.send({ kind: 'sample', sample: k }) }, make('b', {}, word(titles[k])), make('small', {}, word('pictures', own.length))));
  return make('div', { className: 'row' }, make('h2', {}, word('try_sample')), ...buttons);
}

function recent(shell, works) {
  if (!works.length) return null;
  const days = new Intl.DateTimeFormat(document.documentElement.lang, { dateStyle: 'medium', timeStyle: 'short' });
  const cards = works.map((work, k) => make('div', { className: 'recent' },
    make('button', { className: 'card', onclick: () => shell.send({ kind: 'resume', work: k }) }, make('b', {}, work.names.slice(0, 2).join(', ')), make('small', {}, `${word('pictures', count.format(work.count))} · ${days.format(work.at * 1000)}`)),
    make('button', { className: 'plain', title: word('forget'), 'aria-label': word('forget'), onclick: () => shell.send({ kind: 'forget', work: k }) }, icon('close'))));
  return make('div', { className: 'row' }, make('h2', {}, word('edited_last')), ...cards);
}

async function open(shell, files) {
  const numbers = [];
  const all = [...files];
  if (!all.length) { shell.say(word('no_pictures'), 'bad'); return; }
  for (const [k, file] of all.entries()) {
    shell.say(word('taking', k + 1, all.length));
    const answer = await fetch(`drop?name=${encodeURIComponent(file.name)}`, { method: 'POST', body: file });
    const told = await answer.json();
    if (!answer.ok) { shell.say(told.text, 'bad'); return; }
    numbers.push(told.file);
  }
  shell.say('');
  shell.send({ kind: 'open', files: numbers });
}
