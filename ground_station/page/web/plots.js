/** Plots over time in the colours of the page. */
import { theme } from './dom.js';

const AXIS_PX = 52;

/** A plot of lines `{ stroke, dash }` in an element; plots of one page share their cursor. */
export const newPlot = (box, lines, hooks = {}) => {
  const colour = theme();
  const axis = { stroke: colour('quiet'), grid: { stroke: colour('grid'), width: 1 }, ticks: { stroke: colour('grid') }, font: '11px system-ui, sans-serif' };
  return new uPlot({
    width: 280, height: 100, legend: { show: false }, cursor: { sync: { key: 'time' }, drag: { x: false, y: false } },
    scales: { x: { time: false } },
    axes: [{ ...axis, size: 26, values: (_, ticks) => ticks.map((tick) => `${tick} s`) }, { ...axis, size: AXIS_PX }],
    series: [{}, ...lines.map((line) => ({ ...line, width: 1.5, points: { show: false } }))],
    hooks,
  }, [[]], box);
};
