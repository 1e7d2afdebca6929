/** Vehicles as convex faces in their own frame [m], nose along x: `dark` or coloured, rotors transparent. */

const ring = (radius, height, count, x = 0, y = 0) => [...Array(count).keys()].map((i) => {
  const angle = 2 * Math.PI * i / count;
  return [x + radius * Math.cos(angle), y + radius * Math.sin(angle), height];
});

const box = ([x, y, z], [a, b, c], dark) => {
  const corner = (i, j, k) => [x + i * a / 2, y + j * b / 2, z + k * c / 2];
  return [
    [corner(1, -1, -1), corner(1, 1, -1), corner(1, 1, 1), corner(1, -1, 1)],
    [corner(-1, 1, -1), corner(-1, -1, -1), corner(-1, -1, 1), corner(-1, 1, 1)],
    [corner(1, 1, -1), corner(-1, 1, -1), corner(-1, 1, 1), corner(1, 1, 1)],
    [corner(-1, -1, -1), corner(1, -1, -1), corner(1, -1, 1), corner(-1, -1, 1)],
    [corner(-1, -1, 1), corner(1, -1, 1), corner(1, 1, 1), corner(-1, 1, 1)],
    [corner(-1, 1, -1), corner(1, 1, -1), corner(1, -1, -1), corner(-1, -1, -1)],
  ].map((points) => ({ points, dark }));
};

const ellipsoid = ([a, b, c], around, along) => {
  const point = (i, j) => {
    const azimuth = 2 * Math.PI * i / around, polar = Math.PI * j / along;
    return [a * Math.cos(polar), b * Math.sin(polar) * Math.cos(azimuth), c * Math.sin(polar) * Math.sin(azimuth)];
  };
  const faces = [];
  for (let i = 0; i < around; i += 1) {
    for (let j = 0; j < along; j += 1) faces.push({ points: [point(i, j), point(i, j + 1), point(i + 1, j + 1), point(i + 1, j)] });
  }
  return faces;
};

const rotor = (radius, height, x = 0, y = 0) => ({ points: ring(radius, height, 20, x, y), rotor: true });

const helicopter = [
  ...ellipsoid([0.075, 0.036, 0.042], 10, 7), ...box([-0.12, 0, 0.01], [0.14, 0.012, 0.014]),
  ...box([-0.18, 0, 0.025], [0.03, 0.006, 0.05]), ...box([0, 0, 0.055], [0.008, 0.008, 0.045], true),
  rotor(0.115, 0.078), rotor(0.115, 0.058),
];
const quadrotor = [
  ...box([0, 0, 0], [0.07, 0.045, 0.03]), ...box([0.04, 0, 0.005], [0.02, 0.02, 0.02]),
  ...[[1, 1], [1, -1], [-1, 1], [-1, -1]].flatMap(([i, j]) => [
    ...box([0.045 * i, 0.045 * j, 0], [0.02, 0.02, 0.02], true), rotor(0.042, 0.018, 0.055 * i, 0.055 * j),
  ]),
];

/** Faces of an airframe. */
export const shapeOf = (airframe) => (airframe === 'attitude' ? quadrotor : helicopter);
