/** Places of followers relative to their leaders, flown and wanted: a plot for each pair, for recordings. */
import { make, one } from './dom.js';
import { newPlot } from './plots.js';

const WANTED = [4, 4], HEIGHT_PX = 170;
const AXES = [['x_m', '#d62728'], ['y_m', '#2ca02c'], ['z_m', '#1f77b4']];

/** Draw the pairs that flew together at any time when the element is opened; none in a page without it. */
export const drawPlaces = (section, fleet, samples, motion) => {
  if (!section) return;
  const list = one('div', section), pairs = fleet.vehicles.flatMap(({ name }) => {
    const leaders = new Set(motion.flatMap((step) => step[name]?.following ?? []));
    return [...leaders].map((leader) => [name, leader]);
  });
  section.hidden = pairs.length === 0;
  const draw = () => {
    list.replaceChildren();
    if (!section.open) return;
    const times = samples.rows.map((row) => row[0]);
    for (const [name, leader] of pairs) {
      const column = (vehicle, signal) => samples.column(vehicle, signal, samples.rows);
      const beside = (signal, axis) => {
        const other = column(leader, axis);
        return column(name, signal).map((value, row) => {
          const follows = motion[row][name]?.following?.includes(leader);
          return !follows || value === null || other[row] === null ? null : 1000 * (value - other[row]);
        });
      };
      const box = make('div', { className: 'plot' }, make('h3', { textContent: `${name} beside ${leader} [mm]: x red, y green, z blue, wanted dashed` }));
      list.append(box);
      const lines = AXES.flatMap(([, stroke]) => [{ stroke }, { stroke, dash: WANTED }]);
      const plot = newPlot(box, lines);
      plot.setData([times, ...AXES.flatMap(([axis]) => [beside(axis, axis), beside(`reference_${axis}`, axis)])]);
      plot.setSize({ width: list.clientWidth, height: HEIGHT_PX });
    }
  };
  section.ontoggle = draw;
  draw();
};
