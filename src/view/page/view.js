"use strict";
// Shows one or two volumes that the server hands out plane by plane (src/view/server.h).

// Returns a source (planes.js) of a volume of the server. `unit` is the side of its voxel.
function servedSource(description, index, unit, isInA, largestSide) {
  const {contrast} = description, range = contrast[1] - contrast[0];
  const plane = async ({centre, u, v, width, height, step}) => {
    width = Math.min(width, largestSide);
    height = Math.min(height, largestSide);
    const query = new URLSearchParams({volume: index, width, height, step: step / unit,
                                       center: centre.map(value => value / unit), right: u, up: v});
    const answer = await fetch(`plane?${query}`).catch(() => {
      throw new Error("tomofield has ended: start `tomofield view` again");
    });
    if (!answer.ok) throw new Error(await answer.text());
    const across = width * step, up = height * step;
    return {values: new Float32Array(await answer.arrayBuffer()), width, height, across, up,
            left: dot(centre, u) - across / 2, bottom: dot(centre, v) - up / 2, offset: 0, factor: 1};
  };
  return {size: description.size.map(count => count * unit), voxel: unit, scroll: [unit, unit, unit],
          isInA, contrast, limits: [contrast[0] - range, contrast[1] + range], plane};
}

// Returns the switch of the oblique plane and its angles.
function obliqueControls(view, all, fit) {
  const names = ["about x", "about y", "about z"];
  const sliders = names.map((name, axis) => {
    const slider = new Slider(name, {min: -180, max: 180, step: 1}, angle => {
      view.angles = view.angles.map((old, i) => i === axis ? angle : old);
      slider.show(angle, `${angle}°`);
      view.changed();
    });
    slider.input.dataset.angle = "xyz"[axis];
    slider.show(0, "0°");
    slider.row.hidden = true;
    return slider;
  });
  const box = element("input", {type: "checkbox", id: "oblique", onchange: () => {
    for (const slider of sliders) slider.row.hidden = !box.checked;
    for (const planes of all) planes.setOblique(box.checked);
    fit();
  }});
  return [element("label", {className: "check"}, box, " oblique plane through the crossing"),
          ...sliders.map(slider => slider.row)];
}

async function showVolumes() {
  const {volumes, largest_side_px: largestSide} = await (await fetch("info")).json();
  const isInA = volumes.every(volume => volume.voxel_size_A > 0);
  const sources = volumes.map((volume, index) =>
      servedSource(volume, index, isInA ? volume.voxel_size_A : 1, isInA, largestSide));
  const size = [0, 1, 2].map(axis => Math.max(...sources.map(source => source.size[axis])));
  const view = new View(size);
  document.title = volumes.map(volume => volume.title).join(" | ");
  const root = document.getElementById("volumes"), controls = document.getElementById("controls");
  const all = sources.map((source, index) => {
    const {size: voxels, voxel_size_A: voxel, note} = volumes[index];
    const about = `${voxels.join(" × ")} voxels` + (isInA ? ` of ${short(voxel)} Å` : "") +
                  (note && `; ${note}`);
    const shown = element("div", {className: "shown"},
        element("h2", {}, volumes[index].title),
        element("p", {className: "soft", title: about}, about));
    root.append(shown);
    const planes = new Planes(shown, source, view);
    planes.root = shown;
    return planes;
  });
  const fit = () => {
    const height = Math.max(240, window.innerHeight - all[0].grid.offsetTop - 60);
    for (const planes of all) planes.resize(planes.root.clientWidth, height);
  };
  controls.append(...positionControls(view, sources[0]), ...viewControls(view));
  all.forEach((planes, index) =>
      controls.append(...contrastControls(planes, all.length > 1 ? ` ${index + 1}` : "")));
  controls.append(...obliqueControls(view, all, fit), element("p", {className: "soft"},
      "Wheel: scroll; Ctrl and wheel: zoom; click: move the planes there; drag: pan. " +
      "Arrow keys, + and −: the plane that was clicked."));
  window.addEventListener("resize", fit);
  fit();
  document.body.dataset.ready = "yes";
}

showVolumes().catch(error => {
  document.getElementById("volumes").textContent = `The volumes cannot be shown: ${error.message}`;
});
