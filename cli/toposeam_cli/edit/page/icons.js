// Icons, 24 × 24, drawn with one pen.
const PATHS = {
  push: 'M4 12h11M11 7l5 5-5 5M20 5v14',
  hide: 'M4 4l16 16M9.9 5.2A9.6 9.6 0 0 1 12 5c5 0 8.5 4.3 9.5 7a12 12 0 0 1-2.8 4M6.3 7.3A12 12 0 0 0 2.5 12c1 2.7 4.5 7 9.5 7a9 9 0 0 0 4.2-1M10 10a3 3 0 0 0 4 4',
  away: 'M12 3v5M12 16v5M3 12h4M17 12h4M12 8a4 4 0 1 1 0 8 4 4 0 0 1 0-8',
  erase: 'M8 20h12M5.5 14.5l8.8-8.8a2 2 0 0 1 2.8 0l2.2 2.2a2 2 0 0 1 0 2.8L11 19H8.5l-3-3a1 1 0 0 1 0-1.5M10 10l5 5',
  lens: 'M10.5 4a6.5 6.5 0 1 1 0 13 6.5 6.5 0 0 1 0-13M15.5 15.5L21 21',
  seams: 'M9 3c0 3 5 3.500 5 7s-5 3.500-5 7c0 2 1.500 2.500 3 4',
  before: 'M12 4v16M4 6h5v12H4zM15 6h5v12h-5z',
  undo: 'M8 5L4 9l4 4M4 9h10a6 6 0 0 1 0 12h-3',
  redo: 'M16 5l4 4-4 4M20 9H10a6 6 0 0 0 0 12h3',
  more: 'M4 7h9M17 7h3M15 5v4M4 17h3M11 17h9M9 15v4M4 12h3M11 12h9',
  save: 'M12 4v11M7 10l5 5 5-5M4 20h16',
  other: 'M4 19V9a5 5 0 0 1 10 0v6a3 3 0 0 0 6 0V6M17 9l3-3 3 3',
  tick: 'M4 12.500l5 5L20 6.500',
  close: 'M6 6l12 12M18 6L6 18',
  list: 'M4 6h4v4H4zM4 14h4v4H4zM11 8h9M11 16h9',
  fit: 'M4 9V4h5M15 4h5v5M20 15v5h-5M9 20H4v-5',
};

export function icon(name) {
  const svg = document.createElementNS('http://www.w3.org/2000/svg', 'svg');
  svg.setAttribute('viewBox', '0 0 24 24');
  svg.setAttribute('aria-hidden', 'true');
  const path = document.createElementNS('http://www.w3.org/2000/svg', 'path');
  path.setAttribute('d', PATHS[name]);
  svg.append(path);
  return svg;
}
