// Decides which page shows: the one to drop pictures on, or the one where seams move.
import { Shell } from './shell.js';
import { loadWords } from './words.js';
import { showDrop } from './drop.js';
import { Prints } from './prints.js';
import { Seams } from './seams.js';

await loadWords();
const shell = new Shell();
let prints = null, seams = null, restDue = null;

function clear() {
  prints?.remove(); seams?.remove();
  prints = seams = null;
}

shell.on('hello', head => {
  if (head.begun) document.getElementById('drop')?.remove();
  else { clear(); shell.bars(null); showDrop(shell, head); }
});
shell.on('prints', head => { clear(); document.getElementById('drop')?.remove(); shell.bars(null); prints = new Prints(shell, head.names); });
shell.on('print', (head, blocks) => prints?.add(head.number, head.size, blocks[0]));
shell.on('placing', head => prints?.placing(head.share));
shell.on('refused', head => {
  if (!prints) prints = new Prints(shell, []);
  prints.refuse(head.text);
});
shell.on('scene', async (head, blocks) => {
  seams?.remove();
  seams = new Seams(shell, head);
  await seams.load(blocks);
  if (prints) { await prints.slide(seams); prints = null; } else seams.show();
});
shell.on('state', (head, blocks) => seams?.take(head, blocks));
shell.on('crop', head => seams?.crop.show(head.box));
shell.on('rest', head => seams?.rest(head));
shell.on('blend', (head, blocks) => seams?.blended(head.box, blocks[0]));
shell.connect();
