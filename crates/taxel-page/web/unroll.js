// The skin laid flat. Patches wrap around limbs: the surface is cut where it has its widest gap and unrolled about its axis,
// each module kept in its own shape.

export const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const sub = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
export const scaled = (a, k) => [a[0] * k, a[1] * k, a[2] * k];
export const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
export const unit = (a) => scaled(a, 1 / (Math.hypot(...a) || 1));
export const mean = (list) => scaled(list.reduce((s, a) => [s[0] + a[0], s[1] + a[1], s[2] + a[2]], [0, 0, 0]), 1 / (list.length || 1));
export const vector = (v, k = 1) => [(v.x ?? 0) * k, (v.y ?? 0) * k, (v.z ?? 0) * k];

/** Eigenvectors of the covariance of some vectors about `about`, by Jacobi rotations; the least first. */
export function directions(list, about) {
  const m = [[0, 0, 0], [0, 0, 0], [0, 0, 0]];
  for (const a of list) {
    const d = sub(a, about);
    for (let i = 0; i < 3; i++) for (let j = 0; j < 3; j++) m[i][j] += d[i] * d[j];
  }
  const v = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
  for (let sweep = 0; sweep < 12; sweep++) {
    for (const [p, q] of [[0, 1], [0, 2], [1, 2]]) {
      if (Math.abs(m[p][q]) < 1e-18) continue;
      const angle = 0.5 * Math.atan2(2 * m[p][q], m[q][q] - m[p][p]);
      const [c, s] = [Math.cos(angle), Math.sin(angle)];
      for (let k = 0; k < 3; k++) [m[k][p], m[k][q]] = [c * m[k][p] - s * m[k][q], s * m[k][p] + c * m[k][q]];
      for (let k = 0; k < 3; k++) [m[p][k], m[q][k]] = [c * m[p][k] - s * m[q][k], s * m[p][k] + c * m[q][k]];
      for (let k = 0; k < 3; k++) [v[k][p], v[k][q]] = [c * v[k][p] - s * v[k][q], s * v[k][p] + c * v[k][q]];
    }
  }
  return [0, 1, 2].sort((a, b) => m[a][a] - m[b][b]).map((i) => unit([v[0][i], v[1][i], v[2][i]]));
}

/** Taxels by module, in the order of the patch. */
function modulesOf(skin) {
  const groups = new Map();
  for (const taxel of skin.taxels) {
    const key = `${taxel.bus ?? 0}/${taxel.board ?? 0}/${taxel.module ?? 0}`;
    if (!groups.has(key)) groups.set(key, { name: "", taxels: [] });
    const group = groups.get(key);
    group.taxels.push(taxel.taxel ?? 0);
    group.name = `board ${taxel.board ?? "?"} module ${taxel.module ?? 0}`;
  }
  return [...groups.values()];
}

/** Where the taxels of a module lie if nobody says: rows of four, three, two, one, as an iCub triangle has them. */
function template(index, count) {
  if (count !== 10) return [6 * (index % 4), 6 * Math.floor(index / 4)];
  let [row, left] = [0, index];
  while (left >= 4 - row) { left -= 4 - row; row += 1; }
  return [6 * left + 3 * row, 5.2 * row];
}

/** Modules side by side, for a patch without positions. */
function sideBySide(modules, points, top) {
  const wide = Math.ceil(Math.sqrt(modules.length * 1.8));
  modules.forEach((module, at) => {
    const [x, y] = [(at % wide) * 30, top + Math.floor(at / wide) * 26];
    module.taxels.forEach((taxel, index) => {
      const [dx, dy] = template(index, module.taxels.length);
      points[taxel] = { x: x + dx, y: y + dy };
    });
  });
}

/** Axis, centre and radius of the surface that the normals stand on. */
function surface(modules) {
  const normals = modules.map((m) => m.normal);
  const centres = modules.map((m) => m.centre);
  const [n, p] = [mean(normals), mean(centres)];
  if (modules.length < 3 || Math.hypot(...n) > 0.93) {
    const [, second, first] = directions(centres, p);
    const normal = unit(n);
    const axis = unit(sub(modules.length > 2 ? first : second, scaled(normal, dot(modules.length > 2 ? first : second, normal))));
    return { axis, flat: true, normal, origin: p };
  }
  const axis = directions(normals, [0, 0, 0])[0];
  const across = (a) => sub(a, scaled(axis, dot(a, axis)));
  let [both, square] = [0, 0];
  normals.forEach((normal, i) => {
    const [dn, dp] = [across(sub(normal, n)), across(sub(centres[i], p))];
    both += dot(dn, dp);
    square += dot(dn, dn);
  });
  const radius = Math.abs(both / (square || 1));
  return { axis, flat: false, origin: sub(p, scaled(across(n), radius)), radius };
}

/** Angles of the modules about the axis, from the middle of the widest gap on, and the radius at each. */
function angles(modules, { axis, origin }) {
  const across = (a) => sub(a, scaled(axis, dot(a, axis)));
  const first = unit(across(modules[0].normal));
  const second = cross(axis, first);
  const raw = modules.map((m) => {
    const d = across(sub(m.centre, origin));
    return Math.atan2(dot(d, second), dot(d, first));
  });
  const sorted = [...raw].sort((a, b) => a - b);
  let [cut, widest] = [sorted[0], 0];
  sorted.forEach((angle, i) => {
    const before = i ? sorted[i - 1] : sorted.at(-1) - 2 * Math.PI;
    if (angle - before > widest) [cut, widest] = [(angle + before) / 2, angle - before];
  });
  return raw.map((angle) => (((angle - cut) % (2 * Math.PI)) + 2 * Math.PI) % (2 * Math.PI) - Math.PI);
}

/** The skin of one patch laid flat, in mm, x to the right and y down, seen from outside. */
export function unroll(skin) {
  const points = new Array(skin.taxels.length);
  const at = skin.taxels.map((taxel) => (taxel.positionM ? vector(taxel.positionM, 1000) : null));
  const modules = modulesOf(skin);
  const posed = modules.filter((module) => module.taxels.filter((t) => at[t]).length >= 3);
  const middle = mean(at.filter(Boolean));
  for (const module of posed) {
    const places = module.taxels.map((t) => at[t]).filter(Boolean);
    module.centre = mean(places);
    const told = module.taxels.map((t) => skin.taxels[t].normal).filter(Boolean);
    const normal = told.length ? unit(mean(told.map((n) => vector(n)))) : directions(places, module.centre)[0];
    module.normal = told.length || dot(normal, sub(module.centre, middle)) >= 0 ? normal : scaled(normal, -1);
  }
  if (posed.length) lay(posed, surface(posed), at, points);
  const bottom = Math.max(0, ...points.filter(Boolean).map((point) => point.y));
  const rest = modules.filter((module) => module.taxels.some((t) => !points[t]));
  if (rest.length) sideBySide(rest, points, posed.length ? bottom + 20 : 0);
  return finish(points, modules, at, posed.length > 0);
}

/** Each posed module as a rigid piece at its place on the unrolled surface. */
function lay(modules, about, at, points) {
  const { axis, origin } = about;
  const turn = about.flat ? null : angles(modules, about);
  modules.forEach((module, i) => {
    const along = unit(sub(axis, scaled(module.normal, dot(axis, module.normal))));
    const around = cross(along, module.normal);
    const d = sub(module.centre, origin);
    const across = sub(d, scaled(axis, dot(d, axis)));
    // Increasing angle runs along axis x normal, which is down when seen from outside with the axis to the right.
    const y = about.flat ? dot(d, cross(axis, about.normal)) : turn[i] * Math.hypot(...across);
    const centre = [dot(d, axis), y];
    module.axes = { along, around };
    for (const t of module.taxels) {
      if (!at[t]) continue;
      const from = sub(at[t], module.centre);
      points[t] = { x: centre[0] + dot(from, along), y: centre[1] + dot(from, around) };
    }
  });
}

/** Radii, outlines, and the way from a place in space to one on the flat skin. */
function finish(points, modules, at, hasPositions) {
  const radii = new Array(points.length);
  const moduleOf = new Array(points.length);
  for (const module of modules) {
    module.hull = hull(module.taxels.map((t) => [points[t].x, points[t].y]));
    for (const t of module.taxels) {
      moduleOf[t] = module;
      const far = (o) => Math.hypot(points[o].x - points[t].x, points[o].y - points[t].y);
      radii[t] = Math.min(12, ...module.taxels.filter((o) => o !== t).map(far));
    }
  }
  // One size for all, a little less than would fit: modules may lie close together and must not hide each other's taxels.
  const usual = [...radii].sort((a, b) => a - b)[radii.length >> 1] || 6;
  radii.fill(Math.min(4, Math.max(0.8, 0.4 * usual)));
  const project = (place) => {
    const p = vector(place, 1000);
    const near = at.map((a, t) => (a ? [Math.hypot(...sub(a, p)), t] : null)).filter(Boolean).sort((a, b) => a[0] - b[0]).slice(0, 4);
    if (!near.length) return null;
    const home = moduleOf[near[0][1]];
    let [x, y, sum] = [0, 0, 0];
    for (const [distance, t] of near.filter(([, t]) => Math.hypot(points[t].x - points[near[0][1]].x, points[t].y - points[near[0][1]].y) < 30)) {
      const weight = 1 / (distance * distance + 0.5);
      x += weight * points[t].x;
      y += weight * points[t].y;
      sum += weight;
    }
    return { x: x / sum, y: y / sum, axes: home.axes };
  };
  const [xs, ys] = [points.map((p) => p.x), points.map((p) => p.y)];
  const box = { left: Math.min(...xs) - 8, top: Math.min(...ys) - 8, right: Math.max(...xs) + 8, bottom: Math.max(...ys) + 8 };
  return { points, radii, modules, moduleOf, project, box, hasPositions };
}

/** Convex outline of some points, pushed outwards by 5 mm. */
function hull(points) {
  const sorted = [...points].sort((a, b) => a[0] - b[0] || a[1] - b[1]);
  const half = (list) => {
    const chain = [];
    for (const p of list) {
      while (chain.length > 1) {
        const [a, b] = chain.slice(-2);
        if ((b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]) > 0) break;
        chain.pop();
      }
      chain.push(p);
    }
    return chain.slice(0, -1);
  };
  const outline = [...half(sorted), ...half(sorted.reverse())];
  const centre = [0, 1].map((i) => outline.reduce((s, p) => s + p[i], 0) / (outline.length || 1));
  return outline.map((p) => {
    const d = [p[0] - centre[0], p[1] - centre[1]];
    const length = Math.hypot(...d) || 1;
    return [p[0] + (4.5 * d[0]) / length, p[1] + (4.5 * d[1]) / length];
  });
}
