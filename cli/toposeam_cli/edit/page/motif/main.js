// The page on which a motif grows.
import { Shell } from '../shell.js';
import { loadWords, word } from '../words.js';
import { Motif } from './motif.js';

await loadWords();
const shell = new Shell();
shell.format = 'png';
let offer = null, motif = null;

shell.on('hello', head => {
  offer = head;
  if (!motif) shell.say(word('growing'));
});
shell.on('refused', head => { motif?.remove(); motif = null; shell.say(head.text, 'bad'); });
shell.on('state', head => {
  if (!motif) shell.say('');
  motif ??= new Motif(shell, offer);
  motif.take(head);
  shell.steps(head); // bars that were just made know of no steps yet
});
shell.on('density', (head, blocks) => motif?.grown(head, blocks));
shell.on('finishing', head => motif?.panels.finishing(head.share));
shell.on('relatives', head => motif?.strip.relatives(head.count));
shell.on('relative', (head, blocks) => motif?.strip.relative(head, blocks));
shell.connect();
