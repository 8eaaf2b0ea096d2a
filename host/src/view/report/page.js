"use strict";
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const by = id => document.getElementById(id);
  const make = (tag, text, attributes) => {
    const element = document.createElement(tag);
    if (text !== undefined) element.textContent = text;
    for (const [name, value] of Object.entries(attributes || {})) element.setAttribute(name, value);
    return element;
  };
  const shown = (value, digits) => value === null || value === undefined ? "-" : value.toFixed(digits);

  // Colours: Okabe and Ito's for lines, which the colour-blind tell apart.
  const LINES = ["#0072b2", "#e69f00", "#009e73", "#cc79a7", "#56b4e9", "#d55e00", "#8a8f2a", "#7a5195"];
  const PROVENANCE = ["#dec496", "#7fb6d9", "#e3a06f", "#9aa5ae"];
  const OBJECT = "#dec496", PALM = "#607082", FINGERS = "#8c9cb4", TIPS = "#465468", ARM = "#c9a23a";
  const CONES = "#d6483c", FORCES = "#8e2a9a", WEAKEST = "#00796b", CLOUD = "#2b6cb0", TABLE = "#b9beb9";
  const CONE_MM = 25, ARROW_MM = 70, FORCE_MM_PER_N = 8;

  // Meshes: vertices as three columns, faces as three.
  const empty = () => ({ x: [], y: [], z: [], i: [], j: [], k: [] });
  const vertex = (mesh, p) => { mesh.x.push(p[0]); mesh.y.push(p[1]); mesh.z.push(p[2]); };
  const face = (mesh, a, b, c) => { mesh.i.push(a); mesh.j.push(b); mesh.k.push(c); };
  const plus = (a, b, s) => [a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]];
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const size = a => Math.hypot(...a);
  const unit = a => { const n = size(a); return n > 1e-9 ? a.map(c => c / n) : [0, 0, 1]; };
  const across = axis => {
    const u = unit(cross(axis, Math.abs(axis[0]) < 0.9 ? [1, 0, 0] : [0, 1, 0]));
    return [u, cross(axis, u)];
  };
  const points = flat => Array.from({ length: flat.length / 3 }, (_, n) => flat.slice(3 * n, 3 * n + 3));
  const columns = list => ({ x: list.map(p => p[0]), y: list.map(p => p[1]), z: list.map(p => p[2]) });

  // All points within a radius of a segment.
  const capsule = (mesh, a, b, radius) => {
    const SIDES = 14, RINGS = 4;
    const axis = unit(plus(b, a, -1)), [u, v] = across(axis), first = mesh.x.length;
    for (const [center, sign] of [[a, -1], [b, 1]]) {
      for (let ring = 0; ring < RINGS; ring++) {
        const polar = Math.PI / 2 * (sign < 0 ? RINGS - 1 - ring : ring) / (RINGS - 1);
        const middle = plus(center, axis, sign * radius * Math.sin(polar)), wide = radius * Math.cos(polar);
        for (let side = 0; side < SIDES; side++) {
          const turn = 2 * Math.PI * side / SIDES;
          vertex(mesh, plus(plus(middle, u, wide * Math.cos(turn)), v, wide * Math.sin(turn)));
        }
      }
    }
    for (let ring = 0; ring < 2 * RINGS - 1; ring++) {
      for (let side = 0; side < SIDES; side++) {
        const here = first + ring * SIDES + side, next = first + ring * SIDES + (side + 1) % SIDES;
        face(mesh, here, next, next + SIDES);
        face(mesh, here, next + SIDES, here + SIDES);
      }
    }
  };
  const box = (mesh, corners) => {
    const first = mesh.x.length;
    corners.forEach(p => vertex(mesh, p));
    for (const [a, b, c, d] of [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]) {
      face(mesh, first + a, first + b, first + c);
      face(mesh, first + a, first + c, first + d);
    }
  };
  const cone = (mesh, apex, outward, friction) => {
    const SIDES = 24, [u, v] = across(outward), first = mesh.x.length, rim = plus(apex, outward, CONE_MM);
    vertex(mesh, apex);
    for (let side = 0; side < SIDES; side++) {
      const turn = 2 * Math.PI * side / SIDES, wide = CONE_MM * friction;
      vertex(mesh, plus(plus(rim, u, wide * Math.cos(turn)), v, wide * Math.sin(turn)));
      face(mesh, first, first + 1 + side, first + 1 + (side + 1) % SIDES);
    }
  };

  // The moving bodies at a step.
  const bodies = step => {
    const palm = empty(), fingers = empty(), tips = empty(), arm = empty();
    step.boxes.forEach(corners => box(palm, points(corners)));
    step.fingers.forEach((flat, f) => {
      const chain = points(flat), radii = data.parts.radii[f], last = chain.length - 1;
      for (let n = 1; n <= last; n++) {
        capsule(n === 1 ? palm : fingers, chain[n - 1], chain[n], 0.97 * radii[n - 1]);
      }
      capsule(tips, chain[last], chain[last], radii[last - 1]);
    });
    if (step.arm) {
      const ends = points(step.arm);
      data.arm.forEach((radius, n) => capsule(arm, ends[2 * n], ends[2 * n + 1], radius));
    }
    return [palm, fingers, tips, arm];
  };

  // What belongs to one grasp and does not move.
  const marks = grasp => {
    const cones = empty(), forces = { x: [], y: [], z: [] };
    const line = (to, a, b) => [a, b, [null, null, null]].forEach(p => {
      to.x.push(p[0]); to.y.push(p[1]); to.z.push(p[2]);
    });
    for (const contact of grasp.contacts) {
      cone(cones, contact.at, contact.inward.map(c => -c), contact.friction);
      line(forces, plus(contact.at, contact.force_n, -FORCE_MM_PER_N), contact.at);
    }
    const at = { ...columns(grasp.contacts.map(c => c.at)), text: grasp.contacts.map(c => c.finger) };
    const force = { x: [], y: [], z: [] }, torque = { x: [], y: [], z: [] };
    if (grasp.margins) {
      const w = grasp.margins.weakest, com = data.center_of_mass;
      arrow(line, force, com, w.slice(0, 3));
      arrow(line, torque, com, w.slice(3));
    }
    return { cones, forces, at, force, torque };
  };
  const arrow = (line, to, from, vector) => {
    const long = ARROW_MM * size(vector);
    if (long < 1) return;
    const way = unit(vector), tip = plus(from, way, long), [u, v] = across(way);
    line(to, from, tip);
    for (const [side, sign] of [[u, 1], [u, -1], [v, 1], [v, -1]]) {
      line(to, tip, plus(plus(tip, way, -0.2 * long), side, sign * 0.08 * long));
    }
  };

  let chosen = 0, step = 0, whole = false;
  const solid = (name, mesh, color, more) => ({
    type: "mesh3d", name, ...mesh, color, hoverinfo: "name", flatshading: false, showlegend: false,
    lighting: { ambient: 0.6, diffuse: 0.7, specular: 0.1, roughness: 0.8, facenormalsepsilon: 0 },
    lightposition: { x: 500, y: 2000, z: 3000 }, ...more,
  });
  const strokes = (name, xyz, color, more) => ({
    type: "scatter3d", mode: "lines", name, ...xyz, line: { color, width: 6 }, hoverinfo: "name", showlegend: false, ...more,
  });
  const traces = [], layers = new Map();
  const add = (layer, trace) => {
    layers.set(layer, [...(layers.get(layer) || []), traces.length]);
    return traces.push(trace) - 1;
  };
  let moving = [], fixed = {};
  const build = () => {
    const low = [Infinity, Infinity, Infinity], high = low.map(c => -c);
    const grow = flat => flat.forEach((c, n) => { low[n % 3] = Math.min(low[n % 3], c); high[n % 3] = Math.max(high[n % 3], c); });
    if (data.mesh) {
      const flat = data.mesh.vertices, faces = data.mesh.faces, mesh = { ...columns(points(flat)), i: [], j: [], k: [] };
      for (let n = 0; n < faces.length; n += 3) face(mesh, faces[n], faces[n + 1], faces[n + 2]);
      const from = data.mesh.provenance;
      add("object", solid("object", mesh, OBJECT, from ? { facecolor: from.map(n => PROVENANCE[n]) } : {}));
      grow(flat);
    }
    if (data.cloud) {
      add("scanned points", {
        type: "scatter3d", mode: "markers", name: "scanned points", ...columns(points(data.cloud)),
        marker: { size: 1.3, color: CLOUD }, hoverinfo: "skip", showlegend: false,
        // They lie on the surface and hide its colours.
        visible: !data.mesh,
      });
      if (!data.mesh) grow(data.cloud);
    }
    const grasp = data.grasps[chosen];
    if (grasp) {
      const [palm, fingers, tips, arm] = bodies(grasp.steps[step]), mark = marks(grasp);
      moving = [add("hand", solid("palm", palm, PALM, { flatshading: true })), add("hand", solid("fingers", fingers, FINGERS)),
        add("hand", solid("fingertips", tips, TIPS))];
      if (data.arm) moving.push(add("arm", solid("arm", arm, ARM)));
      fixed = {
        cones: add("contacts", solid("friction cone", mark.cones, CONES, { opacity: 0.5 })),
        at: add("contacts", { type: "scatter3d", mode: "markers+text", name: "contact", ...mark.at,
          marker: { size: 4, color: CONES }, hoverinfo: "text", textposition: "top center", showlegend: false }),
        forces: add("contacts", strokes("squeeze force", mark.forces, FORCES)),
        force: add("weakest wrench", strokes("weakest wrench, force", mark.force, WEAKEST)),
        torque: add("weakest wrench", strokes("weakest wrench, torque axis", mark.torque, WEAKEST, { line: { color: WEAKEST, width: 6, dash: "dash" } })),
      };
      for (const at of [0, grasp.steps.length - 1]) {
        grasp.steps[at].fingers.forEach(grow);
        grasp.steps[at].boxes.forEach(grow);
      }
    }
    add("centre of mass", { type: "scatter3d", mode: "markers", name: "centre of mass", ...columns([data.center_of_mass]),
      marker: { size: 6, symbol: "cross", color: "#111111", line: { color: "#ffffff", width: 1 } }, hoverinfo: "name", showlegend: false });
    if (!Number.isFinite(low[0])) grow(data.center_of_mass.map(c => c - 100).concat(data.center_of_mass.map(c => c + 100)));
    if (data.table_mm !== null) {
      const z = data.table_mm, m = [0, 1].map(a => (low[a] + high[a]) / 2), half = 180;
      const square = [[-1, -1], [1, -1], [1, 1], [-1, 1]].map(([x, y]) => [m[0] + half * x, m[1] + half * y, z]);
      add("table", solid("table", { ...columns(square), i: [0, 0], j: [1, 2], k: [2, 3] }, TABLE, { opacity: 0.6 }));
    }
    return [low, high];
  };
  const [low, high] = build();
  const middle = low.map((c, n) => (c + high[n]) / 2), half = 20 + Math.max(...low.map((c, n) => (high[n] - c) / 2));
  const ranges = () => {
    // The whole cell reaches from the arm's base to the object, and as high as the arm.
    const [lows, highs] = whole ? [[-350, -450, -50], [700, 450, 950]] : [middle.map(c => c - half), middle.map(c => c + half)];
    return lows.map((c, n) => [Math.min(c, whole ? low[n] : c), Math.max(highs[n], whole ? high[n] : highs[n])]);
  };
  const paint = () => {
    const style = getComputedStyle(document.documentElement), of = name => style.getPropertyValue(name).trim();
    return { ink: of("--ink"), line: of("--line") };
  };
  const CONFIG = { responsive: true, displaylogo: false, modeBarButtonsToRemove: ["toImage"] };
  const FLAT_CONFIG = { responsive: true, displayModeBar: false };
  const sceneLayout = () => {
    const { ink, line } = paint(), [x, y, z] = ranges();
    const axis = (title, range) => ({ title: { text: title }, range, color: ink, gridcolor: line, showbackground: false, showspikes: false });
    const spread = [x, y, z].map(r => r[1] - r[0]), most = Math.max(...spread);
    return {
      margin: { l: 0, r: 0, t: 0, b: 0 }, paper_bgcolor: "rgba(0,0,0,0)", font: { color: ink }, uirevision: "kept",
      scene: {
        xaxis: axis("x / mm", x), yaxis: axis("y / mm", y), zaxis: axis("z / mm", z), uirevision: "kept",
        aspectmode: "manual", aspectratio: { x: spread[0] / most, y: spread[1] / most, z: spread[2] / most },
        camera: { eye: { x: 0.5, y: 1.35, z: 0.55 }, up: { x: 0, y: 0, z: 1 } },
      },
    };
  };
  const flatLayout = (xTitle, yTitle, more) => {
    const { ink, line } = paint();
    const axis = title => ({ title: { text: title }, color: ink, gridcolor: line, zerolinecolor: line, automargin: true });
    return {
      margin: { l: 50, r: 10, t: 10, b: 40 }, paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)", font: { color: ink },
      legend: { orientation: "h", y: 1.02, yanchor: "bottom" }, ...more,
      xaxis: { ...axis(xTitle), ...(more || {}).xaxis }, yaxis: { ...axis(yTitle), ...(more || {}).yaxis },
    };
  };
  const flat = []; // Plots to be painted again when dark and light change.
  const draw = (id, list, layout) => {
    flat.push([id, list, layout]);
    return Plotly.react(id, list, layout(), FLAT_CONFIG);
  };

  const move = () => {
    const stage = data.stages.filter(s => s.step <= step).pop(), next = data.stages.find(s => s.step > step);
    const text = stage.step === step || !next ? stage.name : `${stage.name} to ${next.name}`;
    by("stage").textContent = text;
    by("step").value = step;
    by("step").setAttribute("aria-valuetext", text);
    for (const button of by("stages").children) button.setAttribute("aria-pressed", Number(button.dataset.step) === step);
    const grasp = data.grasps[chosen];
    if (!grasp) return Promise.resolve();
    const all = bodies(grasp.steps[step]).slice(0, moving.length);
    return Plotly.restyle("scene", { x: all.map(m => m.x), y: all.map(m => m.y), z: all.map(m => m.z) }, moving);
  };
  // A call that comes while one is drawn waits, and only the last of those that wait is done.
  let busy = false, again = false;
  const moved = async () => {
    if (busy) { again = true; return; }
    busy = true;
    do { again = false; await move(); } while (again);
    busy = false;
    document.documentElement.dataset.step = step;
  };

  const COLUMNS = [
    ["#", g => g.number, v => v], ["candidate", g => g.candidate, v => v],
    ["epsilon from", g => g.quality.epsilon_low, v => shown(v, 4)], ["to", g => g.quality.epsilon_high, v => shown(v, 4)],
    ["expected", g => g.quality.expected_epsilon, v => shown(v, 4)], ["closes", g => g.quality.closure_chance, v => shown(v, 2)],
    ["joint margin", g => g.quality.limit_margin, v => shown(v, 2)], ["seen", g => g.quality.seen_share, v => shown(v, 2)],
    ["contacts", g => g.contacts.length, v => v],
  ];
  const order = { column: 0, sign: 1 };
  const list = () => {
    const table = by("grasps"), head = make("tr"), focused = document.activeElement && document.activeElement.id;
    table.replaceChildren(make("caption", "", {}), make("thead"), make("tbody"));
    table.caption.remove();
    COLUMNS.forEach(([name], n) => {
      const sorted = n === order.column ? (order.sign > 0 ? "ascending" : "descending") : "none";
      const cell = make("th", undefined, { scope: "col", "aria-sort": sorted, class: n === 1 ? "text" : "" });
      const button = make("button", name + (sorted === "none" ? "" : order.sign > 0 ? " \u25b2" : " \u25bc"), { type: "button", id: `sort-${n}` });
      button.onclick = () => { order.sign = n === order.column ? -order.sign : 1; order.column = n; list(); };
      cell.append(button);
      head.append(cell);
    });
    table.tHead.append(head);
    const value = COLUMNS[order.column][1];
    const rows = data.grasps.map((grasp, at) => [value(grasp), at]).sort(([a, m], [b, n]) => {
      if (a === null || b === null) return (a === null) - (b === null) || m - n;
      return order.sign * (a < b ? -1 : a > b ? 1 : 0) || m - n;
    });
    for (const [, at] of rows) {
      const grasp = data.grasps[at], row = make("tr", undefined, { "aria-current": at === chosen });
      COLUMNS.forEach(([, of, text], n) => {
        const cell = make("td", undefined, { class: n === 1 ? "text" : "" });
        if (n === 0) {
          const button = make("button", text(of(grasp)), { type: "button", id: `grasp-${grasp.number}`, "aria-label": `Show grasp ${grasp.number}` });
          button.onclick = () => choose(at);
          cell.append(button);
        } else cell.textContent = text(of(grasp));
        row.append(cell);
      });
      table.tBodies[0].append(row);
    }
    if (focused && by(focused)) by(focused).focus();
  };

  const BARS = ["force", "torque"].flatMap(kind => ["+x", "-x", "+y", "-y", "+z", "-z"].map(way => `${kind} ${way}`));
  const describe = grasp => {
    document.querySelectorAll(".chosen").forEach(span => { span.textContent = grasp.number; });
    const table = by("contacts"), head = make("tr");
    table.replaceChildren(head);
    for (const name of ["finger", "link", "friction", "squeeze N"]) head.append(make("th", name, { scope: "col", class: name === "finger" || name === "link" ? "text" : "" }));
    for (const c of grasp.contacts) {
      const row = make("tr");
      row.append(make("td", c.finger, { class: "text" }), make("td", c.link, { class: "text" }), make("td", shown(c.friction, 2)), make("td", shown(size(c.force_n), 2)));
      table.append(row);
    }
    const margins = grasp.margins;
    if (!margins) {
      by("weakest").textContent = "These contacts do not close by force: there are no margins.";
      Plotly.purge("margins");
      return;
    }
    const w = margins.weakest.map(c => shown(c, 2));
    by("weakest").textContent = `Greatest wrench for a total normal force of 1, torques divided by the torque scale, axes of the base. Weakest: force (${w.slice(0, 3).join(", ")}), torque (${w.slice(3).join(", ")}), up to ${shown(margins.weakest_reach, 4)}; drawn at the centre of mass, the torque's axis dashed. A disturbance against it is the hardest to withstand.`;
    flat.splice(0, flat.length, ...flat.filter(([id]) => id !== "margins"));
    draw("margins", [
      { type: "bar", x: BARS, y: margins.reach, marker: { color: BARS.map((_, n) => LINES[n < 6 ? 0 : 2]) }, hovertemplate: "%{x}: %{y:.4f}<extra></extra>", showlegend: false },
      { type: "scatter", mode: "lines", name: "epsilon, all directions", x: BARS, y: BARS.map(() => grasp.quality.epsilon_low), line: { color: LINES[5], dash: "dash" } },
    ], () => flatLayout("", "reach", { xaxis: { tickangle: -60 } }));
  };
  const choose = async at => {
    chosen = at;
    const grasp = data.grasps[at];
    list();
    describe(grasp);
    const mark = marks(grasp);
    for (const [name, trace] of Object.entries(fixed)) {
      const change = {};
      for (const key of Object.keys(mark[name])) change[key] = [mark[name][key]];
      await Plotly.restyle("scene", change, [trace]);
    }
    await moved();
    document.documentElement.dataset.grasp = grasp.number;
  };

  const brackets = () => {
    const all = data.grasps, low = all.map(g => g.quality.epsilon_low), expected = all.filter(g => g.quality.expected_epsilon !== null);
    const list = [{
      type: "scatter", mode: "markers", name: "epsilon, proven bracket", x: all.map(g => g.number), y: low, marker: { color: LINES[0], size: 8 },
      error_y: { type: "data", symmetric: false, array: all.map((g, n) => g.quality.epsilon_high - low[n]), arrayminus: low.map(() => 0), color: LINES[0] },
    }];
    if (expected.length) list.push({ type: "scatter", mode: "markers", name: "expected under errors", x: expected.map(g => g.number), y: expected.map(g => g.quality.expected_epsilon), marker: { color: LINES[1], symbol: "diamond", size: 8 } });
    draw("brackets", list, () => flatLayout("grasp", "epsilon", { yaxis: { rangemode: "tozero" }, xaxis: { dtick: all.length > 30 ? undefined : 1 } }));
  };

  const FINGERS4 = ["thumb", "index", "middle", "ring"];
  const runPlots = () => {
    const run = data.run, trace = run.trace, t = trace.map(s => s.time_s), lacking = [];
    by("verdict").textContent = `Verdict: ${run.verdict}, after ${shown(run.duration_s, 1)} s. ` + run.events.map(e => `${shown(e.time_s, 2)} s ${e.event}`).join(", ");
    const events = () => run.events.map(e => ({ type: "line", x0: e.time_s, x1: e.time_s, yref: "paper", y0: 0, y1: 1, line: { color: paint().line, width: 1, dash: "dot" } }));
    const plot = (id, title, lines, unitText) => {
      if (!lines.length) { lacking.push(title); return; }
      const holder = make("div"), at = make("div", undefined, { id, class: "plot" });
      holder.append(make("h3", title), at);
      by("plots").append(holder);
      draw(id, lines.map(([name, y], n) => ({ type: "scatter", mode: "lines", name, x: t, y, line: { color: LINES[n % LINES.length], dash: n < LINES.length ? "solid" : "dash" } })), () => flatLayout("time / s", unitText, { shapes: events() }));
    };
    const series = (of, names) => {
      const width = Math.max(0, ...trace.map(s => of(s).length));
      return Array.from({ length: width }, (_, n) => [names[n] || `joint ${n + 1}`, trace.map(s => { const v = of(s)[n]; return v === undefined ? null : v; })]);
    };
    const joints = ["rotation", ...FINGERS4.flatMap(f => ["abduction", "flexion", "middle"].map(j => `${f} ${j}`))];
    plot("tip-forces", "Fingertip forces", series(s => s.tip_force_n, FINGERS4), "N");
    plot("joint-torques", "Joint torques", series(s => s.joint_torque_nm, joints), "N m");
    plot("slip-ratios", "Slip ratio (1 slips)", series(s => s.slip_ratio, FINGERS4), "of the friction cone");
    plot("joint-errors", "Joint angles behind their commands", series(s => s.commanded_rad.length === s.measured_rad.length ? s.commanded_rad.map((c, n) => c - s.measured_rad[n]) : [], joints), "rad");
    const height = (name, key) => {
      const first = trace.find(s => s[key]);
      return first ? [[name, trace.map(s => s[key] ? 1e3 * (s[key][2] - first[key][2]) : null)]] : [];
    };
    plot("heights", "Height since the start", [...height("palm", "palm_position"), ...height("object", "object_position")], "mm");
    if (lacking.length) by("plots").append(make("p", `The record of this run does not hold: ${lacking.join("; ")}.`, { class: "hint", id: "lacking" }));
  };

  const start = async () => {
    by("source").textContent = data.source;
    by("facts").textContent = `${shown(data.mass_kg * 1e3, 0)} g, friction ${data.friction}; hand ${data.hand}; ${data.planned} grasp${data.planned === 1 ? "" : "s"}`;
    by("convention").textContent = data.convention;
    data.notes.forEach(note => by("notes").append(make("li", note)));
    if (data.mesh && data.mesh.provenance) {
      by("legend").append(make("span", "Surface:"));
      data.mesh.names.forEach((name, n) => {
        const item = make("span");
        item.append(make("span", undefined, { class: "swatch", style: `background:${PROVENANCE[n]}` }), name);
        by("legend").append(item);
      });
    }
    await Plotly.newPlot("scene", traces, sceneLayout(), CONFIG);
    const layerBox = (id, text, checked, change) => {
      const label = make("label"), input = make("input", undefined, { type: "checkbox", id });
      input.checked = checked;
      input.onchange = () => change(input.checked);
      label.append(input, text);
      by("layers").append(label);
    };
    for (const [layer, members] of layers) {
      layerBox(`layer-${layer.replaceAll(" ", "-")}`, layer, traces[members[0]].visible !== false, on => Plotly.restyle("scene", { visible: on }, members));
    }
    layerBox("whole", "whole cell", false, on => {
      whole = on;
      const { xaxis, yaxis, zaxis, aspectratio } = sceneLayout().scene;
      Plotly.relayout("scene", { "scene.xaxis.range": xaxis.range, "scene.yaxis.range": yaxis.range, "scene.zaxis.range": zaxis.range, "scene.aspectratio": aspectratio });
    });
    if (data.grasps.length) {
      by("step").max = data.grasps[0].steps.length - 1;
      by("step").oninput = event => { step = Number(event.target.value); moved(); };
      for (const stage of data.stages) {
        const button = make("button", stage.name, { type: "button", "data-step": stage.step });
        button.onclick = () => { step = stage.step; moved(); };
        by("stages").append(button);
      }
      brackets();
      step = data.stages[2].step;
      await choose(0);
    } else {
      by("step").disabled = true;
      by("weakest").textContent = "The plan has no grasp.";
    }
    if (data.run) runPlots();
    else by("verdict").textContent = "No run was given.";
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
      const { ink, line } = paint(), change = { "font.color": ink };
      for (const axis of ["xaxis", "yaxis", "zaxis"]) { change[`scene.${axis}.color`] = ink; change[`scene.${axis}.gridcolor`] = line; }
      Plotly.relayout("scene", change);
      for (const [id, list, layout] of flat) Plotly.react(id, list, layout(), FLAT_CONFIG);
    });
    document.documentElement.dataset.ready = "true";
  };
  start();
})();
