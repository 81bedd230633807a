// The camera: parallel projection, with z (in the plane, y) upwards.

class Camera {
  /**
   * Look at points, of a plane mesh from the front, with a margin (length) around them, and at the
   * ends of arrows and marks beside them.
   */
  constructor(points, plane, room, beside) {
    Object.assign(this, { plane, room });
    const low = [Infinity, Infinity, Infinity];
    const high = [-Infinity, -Infinity, -Infinity];
    const reach = (some) => {
      for (let i = 0; i < some.length; i++) {
        low[i % 3] = Math.min(low[i % 3], some[i]);
        high[i % 3] = Math.max(high[i % 3], some[i]);
      }
      return [[...low], [...high]];
    };
    const [least, most] = reach(points);
    Object.assign(this, { low: least, high: most, wide: reach(beside) });
    this.radius = 0.5 * Math.hypot(...most.map((a, k) => a - least[k])) || 1;
    this.reset();
  }

  /** Look at everything, from the first direction or from a side (degrees). */
  reset(azimuth = this.plane ? -90 : -60, elevation = this.plane ? 90 : 25) {
    Object.assign(this, { azimuth, elevation });
    this.zoom = 1;
    const [low, high] = this.wide;
    this.centre = low.map((a, k) => 0.5 * (a + high[k]));
    const reach = (axis) =>
      axis.reduce((sum, a, k) => sum + 0.5 * Math.abs(a) * (high[k] - low[k]), this.room);
    this.extent = this.axes.slice(0, 2).map(reach);
  }

  /** Return another camera, which looks at everything from a side. */
  seenFrom(azimuth, elevation) {
    const other = Object.assign(Object.create(Camera.prototype), this);
    other.reset(azimuth, elevation);
    return other;
  }

  /** Unit vectors to the right, upwards, and towards the eye. */
  get axes() {
    const [a, e] = [this.azimuth, this.elevation].map((angle) => (angle * Math.PI) / 180);
    const [ca, sa, ce, se] = [Math.cos(a), Math.sin(a), Math.cos(e), Math.sin(e)];
    return [[-sa, ca, 0], [-se * ca, -se * sa, ce], [ce * ca, ce * sa, se]];
  }

  /** Turn by degrees. */
  orbit(right, up) {
    this.azimuth -= right;
    this.elevation = Math.max(-90, Math.min(90, this.elevation + up));
  }

  /** Move by multiples of half the picture's height. */
  pan(right, up, width, height) {
    const [u, v] = this.axes;
    const length = this.half(width, height);
    this.centre = this.centre.map((c, k) => c - length * (right * u[k] + up * v[k]));
  }

  magnify(factor) {
    this.zoom = Math.max(0.2, Math.min(200, this.zoom * factor));
  }

  /** Half the height of the region that a picture with an aspect ratio shows. */
  half(width, height) {
    const [across, up] = this.extent;
    return (1.05 * Math.max(up, (across * height) / width, 1e-3 * this.radius)) / this.zoom;
  }
}
