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
  hand: 'M12 3v18M3 12h18M12 3l-3 3M12 3l3 3M12 21l-3-3M12 21l3-3M3 12l3-3M3 12l3 3M21 12l-3-3M21 12l-3 3',
  source: 'M12 8a4 4 0 1 1 0 8 4 4 0 0 1 0-8M12 2v3M12 19v3M2 12h3M19 12h3M5 5l2 2M17 17l2 2M19 5l-2 2M7 17l-2 2',
  sink: 'M9 9h6v6H9zM12 2v4M10 4.500l2 2 2-2M12 22v-4M10 19.500l2-2 2 2M2 12h4M4.500 10l2 2-2 2M22 12h-4M19.500 10l-2 2 2 2',
  wall: 'M3 5h18v14H3zM3 12h18M9 5v7M15 12v7',
  spots: 'M7 5a2 2 0 1 1 0 4 2 2 0 0 1 0-4M15 14h4v4h-4zM9 9l6 5',
  dice: 'M5 4h14a1 1 0 0 1 1 1v14a1 1 0 0 1-1 1H5a1 1 0 0 1-1-1V5a1 1 0 0 1 1-1M8.500 8.500v.01M15.500 8.500v.01M12 12v.01M8.500 15.500v.01M15.500 15.500v.01',
  relatives: 'M4 4h7v7H4zM13 4h7v7h-7zM4 13h7v7H4zM16.500 13v7M13 16.500h7',
  locked: 'M6 11h12v9H6zM8.500 11V8a3.500 3.500 0 0 1 7 0v3',
  unlocked: 'M6 11h12v9H6zM8.500 11V7a3.500 3.500 0 0 1 6.800-1.200',
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
