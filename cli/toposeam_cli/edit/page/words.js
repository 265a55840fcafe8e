// One table of words for all pages: words.json, one list a word, in the order of its languages.
let table = { languages: ['en'], words: {} };
let at = 0;

export const languages = () => table.languages;
export const language = () => table.languages[at];

export async function loadWords() {
  table = await (await fetch('page/words.json')).json();
  const wanted = [location.hash.slice(1), ...(navigator.languages ?? [navigator.language])];
  const found = wanted.map(name => table.languages.indexOf(name.slice(0, 2))).find(k => k >= 0);
  choose(table.languages[found ?? 0]);
}

export function choose(name) {
  at = Math.max(0, table.languages.indexOf(name));
  document.documentElement.lang = table.languages[at];
}

export function word(key, ...values) {
  const own = table.words[key];
  if (!own) return key;
  return values.reduce((text, value, k) => text.replace(`{${k}}`, value), own[at] || own[0]);
}

const LANGUAGES = { en: 'English', de: 'Deutsch', es: 'Español', fr: 'Français', ja: '日本語', ko: '한국어' };

// The row in which a language is chosen; the page is loaded again in it.
export function languageChoice() {
  const options = languages().map(value => make('option', { value, selected: value === language() }, LANGUAGES[value] ?? value));
  const select = make('select', { id: 'set-language', onchange: () => { choose(select.value); location.hash = select.value; location.reload(); } }, ...options);
  return make('label', {}, make('span', {}, word('language')), select);
}

// Makes an element: name, properties, children.
export function make(name, given = {}, ...children) {
  const element = document.createElement(name);
  for (const [key, value] of Object.entries(given)) {
    if (key.startsWith('on')) element.addEventListener(key.slice(2), value);
    else if (value === false || value == null) continue;
    else if (key in element && !key.startsWith('aria')) element[key] = value;
    else element.setAttribute(key, value);
  }
  element.append(...children.filter(child => child != null));
  return element;
}
