"use strict";
// The cell in three dimensions: bases carry flanges, flanges carry cameras and targets.
(() => {
  const data = JSON.parse(document.getElementById("scene-data").textContent);
  const box = document.querySelector(".live");
  if (!data.samples.length) return;
  let renderer;
  try {
    renderer = new THREE.WebGLRenderer({ antialias: true, alpha: true });
  } catch {
    return; // Without WebGL the still image remains.
  }
  const size = data.size_m;
  const withFlanges = (arm) =>
    Object.assign(arm, { flanges: arm.base_from_flange.map((pose, k) => arm.known[k] ? pose : null) });
  data.arms.forEach(withFlanges);
  const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  const coloured = []; // [material, name of the colour], for a change of scheme
  const material = (Kind, colour, more = {}) => {
    const made = new Kind(more);
    coloured.push([made, colour]);
    return made;
  };
  const geometry = (points) => {
    const made = new THREE.BufferGeometry();
    made.setAttribute("position", new THREE.Float32BufferAttribute(points.flat(Infinity), 3));
    return made;
  };
  const lines = (segments, colour, more) =>
    new THREE.LineSegments(geometry(segments), material(THREE.LineBasicMaterial, colour, more));
  const dots = (points, colour, pixels) =>
    new THREE.Points(geometry(points), material(THREE.PointsMaterial, colour, { size: pixels, sizeAttenuation: false }));
  const place = (group, pose) => {
    group.position.set(pose[0], pose[1], pose[2]);
    group.quaternion.set(pose[3], pose[4], pose[5], pose[6]);
    return group;
  };
  const axes = (length) => {
    const group = new THREE.Group();
    [[length, 0, 0], [0, length, 0], [0, 0, length]].forEach((tip, i) =>
      group.add(lines([[0, 0, 0], tip], ["--x", "--y", "--z"][i])));
    return group;
  };

  const world = new THREE.Scene();
  const flanges = {}; // by robot
  const reaches = []; // [line from base to flange, arm]
  const names = []; // [element, object]
  const name = (text, object, colour = "--ink") => {
    const element = document.createElement("span");
    element.className = "name";
    element.textContent = text;
    element.style.color = `var(${colour})`;
    box.append(element);
    names.push([element, object]);
  };
  const ellipsoid = (semiAxes) => {
    const [a, b, c] = [0, 1, 2].map((k) => new THREE.Vector3(semiAxes[0][k], semiAxes[1][k], semiAxes[2][k]));
    const made = new THREE.Mesh(
      new THREE.SphereGeometry(1, 32, 20),
      material(THREE.MeshLambertMaterial, "--doubtful", { transparent: true, opacity: 0.55, depthWrite: false }),
    );
    made.matrixAutoUpdate = false;
    made.matrix.makeBasis(a, b, c);
    return made;
  };
  // Connection from base to flange: a line if only poses are known, links between joints with a URDF.
  const thread = (colour, skin) => {
    const line = lines([[0, 0, 0], [0, 0, 0]], colour, skin);
    line.frustumCulled = false;
    return {
      object: line,
      follow: (places) => {
        const ends = line.geometry.attributes.position;
        ends.setXYZ(1, ...places[places.length - 1]);
        ends.needsUpdate = true;
      },
    };
  };
  const SIDES = 20;
  const tube = () => {
    // A cylinder of radius and length 1 along z from the origin, open at its ends, which spheres close.
    const made = new THREE.BufferGeometry(), points = [], normals = [], corners = [];
    for (let k = 0; k <= SIDES; k++) {
      const [c, s] = [Math.cos(2 * Math.PI * k / SIDES), Math.sin(2 * Math.PI * k / SIDES)];
      points.push(c, s, 0, c, s, 1);
      normals.push(c, s, 0, c, s, 0);
      if (k < SIDES) corners.push(2 * k, 2 * k + 2, 2 * k + 1, 2 * k + 1, 2 * k + 2, 2 * k + 3);
    }
    made.setAttribute("position", new THREE.Float32BufferAttribute(points, 3));
    made.setAttribute("normal", new THREE.Float32BufferAttribute(normals, 3));
    made.setIndex(corners);
    return made;
  };
  const links = (count, colour, more) => {
    const object = new THREE.Group();
    const radius = 0.016 * size;
    const skin = material(THREE.MeshLambertMaterial, colour, more);
    const bars = [], balls = [];
    for (let k = 0; k < count; k++) {
      bars.push(new THREE.Mesh(tube(), skin));
      balls.push(new THREE.Mesh(new THREE.SphereGeometry(1, 20, 14), skin));
      object.add(bars[k], balls[k]);
    }
    return {
      object,
      follow: (places) => {
        const from = new THREE.Vector3(), to = new THREE.Vector3(), up = new THREE.Vector3(0, 0, 1);
        for (let k = 0; k < count; k++) {
          from.set(...places[k]);
          to.set(...places[k + 1]).sub(from);
          const length = to.length(), thin = radius * (1 - 0.5 * k / count);
          bars[k].visible = length > 1e-6;
          bars[k].position.copy(from);
          if (bars[k].visible) bars[k].quaternion.setFromUnitVectors(up, to.divideScalar(length));
          bars[k].scale.set(thin, thin, Math.max(length, 1e-6));
          balls[k].position.copy(from);
          balls[k].scale.setScalar(thin);
        }
      },
    };
  };
  // Collision bodies of links, each in its frame, around thin links.
  const shapes = (arm) => arm.shapes ??= arm.surfaces.map(({ points, triangles }) => {
    const made = geometry(points);
    made.setIndex(triangles.flat());
    made.computeVertexNormals();
    return made;
  });
  const bodies = (arm, colour, more) => {
    const inner = links(arm.joints[0].length + 1, colour, more), object = new THREE.Group();
    const skin = material(THREE.MeshLambertMaterial, colour, { side: 2, flatShading: true, ...more });
    const parts = shapes(arm).map((shape) => new THREE.Mesh(shape, skin));
    object.add(inner.object, ...parts);
    return {
      object,
      follow: (places) => {
        inner.follow(places);
        parts.forEach((part, k) => { if (arm.surfaces[k].frame) place(part, places[arm.surfaces[k].frame]); });
      },
    };
  };
  // From the pose of a flange to its goal.
  const arrow = (colour) => {
    const object = new THREE.Group(), skin = material(THREE.MeshLambertMaterial, colour);
    const shaft = new THREE.Mesh(tube(), skin), tip = new THREE.Mesh(new THREE.SphereGeometry(1, 20, 14), skin);
    object.add(shaft, tip);
    object.visible = false;
    const thin = 0.006 * size;
    return {
      object,
      follow: (from, to) => {
        const along = new THREE.Vector3(...to).sub(new THREE.Vector3(...from)), length = along.length();
        object.visible = length > thin;
        if (!object.visible) return;
        object.position.set(...from);
        object.quaternion.setFromUnitVectors(new THREE.Vector3(0, 0, 1), along.divideScalar(length));
        shaft.scale.set(thin, thin, length);
        tip.scale.setScalar(2.5 * thin);
        tip.position.set(0, 0, length);
      },
    };
  };
  data.arms.forEach((arm, k) => {
    const colour = `--robot-${k % 4}`;
    const base = place(new THREE.Group(), arm.world_from_base);
    base.add(axes(0.12 * size));
    if (arm.ellipsoid) base.add(ellipsoid(arm.ellipsoid));
    const seen = arm.flanges.filter((pose) => pose);
    if (seen.length) base.add(dots(seen.map((pose) => pose.slice(0, 3)), colour, 4 * Math.min(devicePixelRatio, 2)));
    const flange = new THREE.Group();
    flange.add(axes(0.05 * size));
    base.add(flange);
    const reach = (more) =>
      arm.surfaces.length ? bodies(arm, colour, more)
        : arm.joints ? links(arm.joints[0].length + 1, colour, more) : thread(colour, more);
    const solid = reach();
    base.add(solid.object);
    reaches.push([solid, arm, base, reach, arrow(colour)]);
    base.add(reaches[k][4].object);
    flanges[arm.name] = flange;
    world.add(base);
    name(`${arm.name}_base`, base, colour);
  });
  // The image of a sample is drawn in the frustum of its camera, if the page has it.
  const screens = [];
  const screen = (body) => {
    const ends = body.lines.slice(4).map((edge) => edge[0]), texture = new THREE.Texture();
    texture.colorSpace = THREE.SRGBColorSpace;
    const made = new THREE.Mesh(geometry(ends), new THREE.MeshBasicMaterial({ map: texture, side: 2 }));
    made.geometry.setAttribute("uv", new THREE.Float32BufferAttribute([0, 1, 1, 1, 1, 0, 0, 0], 2));
    made.geometry.setIndex([0, 1, 2, 0, 2, 3]);
    made.visible = false;
    made.userData.isPicture = true;
    screens.push((sample) => {
      const figures = [...document.querySelectorAll(".pictures figure[data-camera]")];
      const one = figures.find(({ dataset }) => dataset.camera === body.name && Number(dataset.sample) === sample);
      made.visible = false;
      if (!one) return;
      const image = new Image();
      image.onload = () => {
        texture.dispose(); // images may differ in size
        texture.image = image;
        texture.needsUpdate = made.visible = true;
        draw();
      };
      image.src = one.querySelector("image").getAttribute("href");
    });
    return made;
  };
  for (const body of data.bodies) {
    const colour = body.kind === "camera" ? "--camera" : "--target";
    const group = place(new THREE.Group(), body.mount);
    group.add(axes(0.03 * size));
    if (body.ellipsoid) group.add(ellipsoid(body.ellipsoid));
    if (body.lines.length) group.add(lines(body.lines, colour));
    if (body.points.length) group.add(dots(body.points, colour, 3 * Math.min(devicePixelRatio, 2)));
    if (body.kind === "camera") group.add(screen(body));
    (body.on === null ? world : flanges[body.on]).add(group);
    name(body.name, group, colour);
  }
  // The expected error over the workspace, more opaque if larger.
  const cloud = new THREE.Group();
  if (data.errors) {
    const { points, mm, worst } = data.errors, low = Math.min(...mm), high = Math.max(...mm), SHADES = 5;
    const shade = (value) => Math.min(SHADES - 1, Math.floor(SHADES * (value - low) / Math.max(high - low, 1e-9)));
    for (let k = 0; k < SHADES; k++) {
      const some = points.filter((_, i) => shade(mm[i]) === k);
      if (!some.length) continue;
      cloud.add(dots(some, "--heat", 7 * Math.min(devicePixelRatio, 2)));
      Object.assign(cloud.children.at(-1).material, { transparent: true, opacity: 0.15 + 0.8 * k / (SHADES - 1) });
    }
    const there = new THREE.Group();
    there.position.set(...points[mm.indexOf(high)]);
    there.add(dots([[0, 0, 0]], "--ink", 9 * Math.min(devicePixelRatio, 2)));
    cloud.add(there);
    name(worst, there);
    world.add(cloud);
  }
  // The floor under the lowest base, a line every half metre, and the distances between the bases.
  const feet = data.arms.map((arm) => arm.world_from_base.slice(0, 3));
  const floor = Math.min(...feet.map((foot) => foot[2]));
  const STEP = 0.5, reach = STEP * Math.ceil(0.7 * size / STEP);
  const [cx, cy] = [0, 1].map((axis) => STEP * Math.round(feet.reduce((sum, foot) => sum + foot[axis], 0) / feet.length / STEP));
  const grid = [];
  for (let d = -reach; d <= reach + 1e-9; d += STEP) {
    grid.push([[cx + d, cy - reach, floor], [cx + d, cy + reach, floor]], [[cx - reach, cy + d, floor], [cx + reach, cy + d, floor]]);
  }
  world.add(lines(grid, "--line"));
  for (const foot of feet.slice(1)) {
    const between = new THREE.Group();
    between.position.set(...[0, 1, 2].map((axis) => (feet[0][axis] + foot[axis]) / 2));
    world.add(lines([[feet[0], foot]], "--soft"), between);
    name(`${(1e3 * Math.hypot(...[0, 1, 2].map((axis) => feet[0][axis] - foot[axis]))).toFixed(0)} mm`, between, "--soft");
  }
  world.add(new THREE.AmbientLight(0xffffff, 1.6));
  const light = new THREE.DirectionalLight(0xffffff, 1.8);
  light.position.set(1, -2, 3);
  world.add(light);

  const eye = new THREE.PerspectiveCamera(35, 1, 0.01 * size, 30 * size);
  eye.up.set(0, 0, 1);
  const controls = new THREE.OrbitControls(eye, renderer.domElement);
  world.updateMatrixWorld(true);
  const extentNow = () => { // extent of the visible content
    const extent = [];
    world.traverse((object) => {
      if (object.isGroup && object !== cloud) extent.push(object.getWorldPosition(new THREE.Vector3()));
    });
    data.arms.forEach((arm, k) => {
      const joints = arm.joints ? arm.joints.flat() : [];
      for (const pose of [...arm.flanges, ...joints, [0.13 * size, 0, 0], [0, 0.13 * size, 0], [0, 0, 0.15 * size], [0, 0, -0.1 * size]]) {
        if (pose) extent.push(new THREE.Vector3(...pose.slice(0, 3)).applyMatrix4(reaches[k][2].matrixWorld));
      }
    });
    return extent;
  };
  const across = new THREE.Vector3(...data.across);
  const away = new THREE.Vector3(0, 0, 1).cross(across);
  const VIEWS = {
    fit: away.clone().multiplyScalar(-0.9).add(new THREE.Vector3(0, 0, 0.43)),
    top: away.clone().multiplyScalar(-0.01).add(new THREE.Vector3(0, 0, 1)),
    front: away.clone().multiplyScalar(-1),
    side: across.clone(),
  };
  const middle = new THREE.Vector3();
  const look = (from) => {
    const extent = extentNow();
    middle.set(0, 0, 0);
    // Alternately centre the content and move as close as possible.
    let distance = 4 * size;
    extent.forEach((point) => middle.addScaledVector(point, 1 / extent.length));
    for (let k = 0; k < 12; k++) {
      eye.position.copy(middle).addScaledVector(from, distance);
      eye.lookAt(middle);
      eye.updateMatrixWorld(true);
      const seen = extent.map((point) => point.clone().project(eye));
      const [x, y] = ["x", "y"].map((axis) => seen.map((point) => point[axis]));
      const [left, right, low, high] = [Math.min(...x), Math.max(...x), Math.min(...y), Math.max(...y)];
      const centre = middle.clone().project(eye);
      middle.set((left + right) / 2, (low + high) / 2, centre.z).unproject(eye);
      distance *= Math.min(Math.max((right - left) / 2, (high - low) / 2) / 0.82, 3);
    }
    controls.target.copy(middle);
    controls.update();
  };
  const corner = new THREE.Vector3();
  const label = ([element, object], placed) => {
    object.getWorldPosition(corner).project(eye);
    const shown = object.visible && object.parent.visible && corner.z < 1;
    element.hidden = !shown;
    if (!shown) return;
    const width = element.offsetWidth, height = element.offsetHeight;
    const x = Math.min((corner.x + 1) / 2 * box.clientWidth + 8, box.clientWidth - width - 2);
    let y = (1 - corner.y) / 2 * box.clientHeight + 4;
    // Move below overlapping labels until there are none.
    const covers = ([left, top, right]) => x < right && left < x + width && Math.abs(y - top) < height - 0.5;
    for (let tries = placed.length; tries > 0; tries--) {
      const other = placed.find(covers);
      if (!other) break;
      y = other[1] + height;
    }
    placed.push([x, y, x + width]);
    element.style.transform = `translate(${x.toFixed(1)}px, ${y.toFixed(1)}px)`;
  };
  let isDue = false;
  // At most once per frame.
  const draw = () => {
    if (isDue) return;
    isDue = true;
    requestAnimationFrame(() => {
      isDue = false;
      renderer.render(world, eye);
      const placed = [];
      for (const one of names) label(one, placed);
    });
  };
  const paint = () => {
    for (const [one, colour] of coloured) one.color.set(css(colour));
    draw();
  };
  let looked = false;
  const resize = () => {
    const width = box.clientWidth, height = box.clientHeight;
    if (!width || !height) return;
    renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    renderer.setSize(width, height);
    eye.aspect = width / height;
    eye.updateProjectionMatrix();
    if (!looked) { looked = true; look(VIEWS.fit); }
    draw();
  };

  const pathOf = (arm, index) => [[0, 0, 0], ...(arm.joints ? arm.joints[index] : []), arm.flanges[index].slice(0, 3)];
  window.showSample = (index) => {
    for (const [reach, arm] of reaches) {
      const pose = arm.flanges[index], flange = flanges[arm.name];
      flange.visible = reach.object.visible = pose !== null;
      if (!pose) continue;
      place(flange, pose);
      reach.follow(pathOf(arm, index));
    }
    for (const one of screens) one(data.samples[index]);
    world.updateMatrixWorld(true);
    draw();
  };
  // Pale arms at other samples.
  const PALE = { transparent: true, opacity: 0.16, depthWrite: false };
  const ghosts = [];
  const showGhosts = (indices) => {
    for (const ghost of ghosts.splice(0)) ghost.removeFromParent();
    for (const [, arm, base, reach] of reaches) {
      for (const index of indices.filter((each) => arm.flanges[each])) {
        const made = reach(PALE);
        made.follow(pathOf(arm, index));
        base.add(made.object);
        ghosts.push(made.object);
      }
    }
    paint();
  };
  // Arms at their poses, index 0, and at their goals, index 1.
  let known = 0, sent = "";
  window.moveArms = (arms) => {
    reaches.forEach(([, arm, , , pointer], k) => {
      if (!arm.joints && arms[k].joints) location.reload(); // joints are now known: links replace lines
      Object.assign(arm, { flanges: withFlanges(arms[k]).flanges, joints: arms[k].joints });
      const [here, there] = arm.flanges;
      if (here && there) pointer.follow(here.slice(0, 3), there.slice(0, 3));
    });
    window.showSample(0);
    const goals = JSON.stringify(arms.map((arm) => arm.flanges[1])), count = arms.filter((arm) => arm.flanges[0]).length;
    if (goals !== sent) showGhosts([1]);
    if (count > known) look(VIEWS.fit);
    [known, sent] = [count, goals];
    draw();
  };

  const turn = (about, angle) => {
    eye.position.sub(controls.target).applyAxisAngle(about, angle).add(controls.target);
    controls.update();
    draw();
  };
  const sideways = () => new THREE.Vector3(1, 0, 0).applyQuaternion(eye.quaternion);
  const KEYS = {
    ArrowLeft: () => turn(eye.up, -0.15),
    ArrowRight: () => turn(eye.up, 0.15),
    ArrowUp: () => turn(sideways(), -0.15),
    ArrowDown: () => turn(sideways(), 0.15),
    "+": () => { eye.position.lerp(controls.target, 0.15); draw(); },
    "-": () => { eye.position.lerp(controls.target, -0.15); draw(); },
  };
  box.addEventListener("keydown", (event) => {
    if (!KEYS[event.key]) return;
    event.preventDefault();
    KEYS[event.key]();
  });
  for (const button of document.querySelectorAll("[data-view]")) {
    button.addEventListener("click", () => { look(VIEWS[button.dataset.view]); draw(); });
  }

  // Export of the scene as glTF 2.0 in one file, in metres; glTF has y upwards.
  window.sceneAsGltf = () => {
    const made = {
      asset: { version: "2.0", generator: "basecal" }, scene: 0, scenes: [{ nodes: [0] }],
      nodes: [{ name: "world", rotation: [-Math.SQRT1_2, 0, 0, Math.SQRT1_2], children: [] }],
      meshes: [], materials: [], accessors: [], bufferViews: [], buffers: [],
    };
    let bytes = "";
    const store = (attribute, isPosition) => {
      const { array, itemSize, count } = attribute;
      const view = new Uint8Array(array.buffer, array.byteOffset, array.byteLength);
      made.bufferViews.push({ buffer: 0, byteOffset: bytes.length, byteLength: view.length });
      for (const byte of view) bytes += String.fromCharCode(byte);
      bytes = bytes.padEnd(4 * Math.ceil(bytes.length / 4), "\0");
      const accessor = { bufferView: made.bufferViews.length - 1, count, type: itemSize === 3 ? "VEC3" : "SCALAR" };
      accessor.componentType = array instanceof Float32Array ? 5126 : array instanceof Uint16Array ? 5123 : 5125;
      if (isPosition) {
        const axes = [0, 1, 2].map((axis) => Array.from({ length: count }, (_, k) => array[3 * k + axis]));
        accessor.min = axes.map((values) => Math.min(...values));
        accessor.max = axes.map((values) => Math.max(...values));
      }
      return made.accessors.push(accessor) - 1;
    };
    const mesh = ({ geometry: { attributes, index }, material: skin, isMesh, isPoints }) => {
      const primitive = { attributes: { POSITION: store(attributes.position, true) }, mode: isMesh ? 4 : isPoints ? 0 : 1 };
      if (isMesh) primitive.attributes.NORMAL = store(attributes.normal);
      if (index) primitive.indices = store(index);
      const look = { pbrMetallicRoughness: { baseColorFactor: [skin.color.r, skin.color.g, skin.color.b, skin.opacity], metallicFactor: 0 } };
      if (skin.transparent) look.alphaMode = "BLEND";
      primitive.material = made.materials.push(look) - 1;
      return made.meshes.push({ primitives: [primitive] }) - 1;
    };
    const add = (object, parent) => {
      if (!object.visible || object.isLight || object.userData.isPicture) return;
      if (object.matrixAutoUpdate) object.updateMatrix();
      const node = { matrix: object.matrix.toArray() }, number = made.nodes.push(node) - 1;
      const named = names.find(([, each]) => each === object);
      if (named) node.name = named[0].textContent;
      if (object.geometry) node.mesh = mesh(object);
      (parent.children ??= []).push(number);
      for (const child of object.children) add(child, node);
    };
    for (const object of world.children) add(object, made.nodes[0]);
    made.buffers.push({ byteLength: bytes.length, uri: `data:application/octet-stream;base64,${btoa(bytes)}` });
    return made;
  };
  const painted = document.querySelector("[data-errors]");
  if (painted) {
    painted.addEventListener("click", () => {
      cloud.visible = !cloud.visible;
      painted.setAttribute("aria-pressed", cloud.visible);
      draw();
    });
  }
  const save = document.querySelector("[data-save]");
  if (save) {
    save.addEventListener("click", () => {
      const link = document.createElement("a");
      link.href = URL.createObjectURL(new Blob([JSON.stringify(window.sceneAsGltf())], { type: "model/gltf+json" }));
      link.download = "cell.gltf";
      link.click();
      setTimeout(() => URL.revokeObjectURL(link.href), 1000);
    });
  }
  const all = document.querySelector("[data-ghosts]");
  if (all) {
    const step = Math.ceil(data.samples.length / 24);
    const some = data.samples.map((_, index) => index).filter((index) => index % step === 0);
    all.addEventListener("click", () => {
      const on = all.getAttribute("aria-pressed") !== "true";
      all.setAttribute("aria-pressed", on);
      showGhosts(on ? some : []);
    });
  }

  box.append(renderer.domElement);
  box.hidden = false;
  const still = document.querySelector(".still"), slider = document.querySelector(".slider");
  if (still) still.hidden = true;
  if (slider) slider.hidden = data.samples.length < 2;
  for (const only of document.querySelectorAll(".only-live")) only.hidden = false;
  controls.addEventListener("change", draw);
  window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", paint);
  window.showSample(data.opening);
  new ResizeObserver(resize).observe(box);
  resize();
  paint();
  document.dispatchEvent(new Event("scene"));
})();
