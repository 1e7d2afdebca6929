/** Samples of all signals of all vehicles, as the page's process sends them. */

const KEPT = 1200;

export class Samples {
  /** @param {{vehicles: {name: string}[], signals: [string, string, string, number][]}} fleet */
  constructor(fleet) {
    this.names = fleet.vehicles.map((vehicle) => vehicle.name);
    this.at = new Map(fleet.signals.map(([name], index) => [name, index]));
    this.rows = [];
    this.kept = fleet.recorded ? Infinity : KEPT;
  }

  /** Add rows: time [s], then the values of each vehicle. */
  add(rows) {
    this.rows.push(...rows);
    if (this.rows.length > this.kept) this.rows.splice(0, this.rows.length - this.kept);
  }

  /** Values of a signal of a vehicle in some rows, null where unknown. */
  column(name, signal, rows) {
    const vehicle = 1 + this.names.indexOf(name), at = this.at.get(signal);
    return rows.map((row) => row[vehicle][at]);
  }

  /** The newest values of a signal within some seconds before row `end`. */
  recent(name, signal, seconds, end = this.rows.length) {
    const vehicle = 1 + this.names.indexOf(name), at = this.at.get(signal), found = [];
    const from = (this.rows[end - 1]?.[0] ?? 0) - seconds;
    for (let index = end - 1; index >= 0 && this.rows[index][0] >= from; index -= 1) {
      found.unshift(this.rows[index][vehicle][at]);
    }
    return found;
  }

  /** Position of a vehicle in a row [m], null where unknown. */
  place(name, row) {
    const values = this.rows[row]?.[1 + this.names.indexOf(name)];
    const place = values && ['x_m', 'y_m', 'z_m'].map((signal) => values[this.at.get(signal)]);
    return place && place.every((value) => value !== null) ? place : null;
  }

  /** First row in which a vehicle has a position; 0 without one. */
  firstSeen() { return Math.max(0, this.rows.findIndex((_, row) => this.names.some((name) => this.place(name, row)))); }

  /** Positions of the last seconds before row `end`, without gaps. */
  trail(name, seconds, end = this.rows.length) {
    const from = (this.rows[end - 1]?.[0] ?? 0) - seconds, found = [];
    for (let index = end - 1; index >= 0 && this.rows[index][0] >= from; index -= 1) {
      const place = this.place(name, index);
      if (place) found.unshift(place);
    }
    return found;
  }
}
