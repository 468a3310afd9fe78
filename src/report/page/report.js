"use strict";
// Shows the volume that the report contains (report/embedded_volume.h).

// Loads a picture and returns its greys, row 0 on top.
async function greysOf(base64) {
  const image = new Image();
  image.src = "data:image/jpeg;base64," + base64;
  await image.decode();
  const canvas = document.createElement("canvas");
  canvas.width = image.naturalWidth;
  canvas.height = image.naturalHeight;
  const context = canvas.getContext("2d", {willReadFrequently: true});
  context.drawImage(image, 0, 0);
  const {data, width, height} = context.getImageData(0, 0, canvas.width, canvas.height);
  const greys = new Uint8Array(width * height);
  for (let i = 0; i < greys.length; ++i) greys[i] = data[4 * i];
  return {greys, width};
}

// Returns all voxels, [z][y][x], as numbers from 0 to 255.
async function voxelsOf({size, tile, columns, rows, sheets}) {
  const [nx, ny, nz] = size;
  const voxels = new Uint8Array(nx * ny * nz);
  for (let z = 0, sheet; z < nz; ++z) {
    const place = z % (columns * rows);
    if (place === 0) sheet = await greysOf(sheets[z / (columns * rows)]);
    const corner = Math.floor(place / columns) * tile[1] * sheet.width + place % columns * tile[0];
    for (let y = 0; y < ny; ++y) {
      const from = corner + (ny - 1 - y) * sheet.width;
      voxels.set(sheet.greys.subarray(from, from + nx), (z * ny + y) * nx);
    }
  }
  return voxels;
}

// Returns a source of whole planes (planes.js).
function embeddedSource(volume, voxels) {
  const {size: reduced, file_size: fileSize, limits, contrast} = volume;
  const isInA = volume.voxel_size_A > 0, voxel = isInA ? volume.voxel_size_A : 1;
  const size = fileSize.map(count => count * voxel);
  const scroll = size.map((length, i) => length / reduced[i]);
  const [nx, ny] = reduced, stride = [1, nx, nx * ny];
  const plane = async ({name, centre}) => {
    const axes = AXES[name], u = axes.u.indexOf(1), v = axes.v.indexOf(1), w = axes.normal;
    const width = reduced[u], height = reduced[v], values = new Uint8Array(width * height);
    const start = clamp(Math.floor(centre[w] / scroll[w]), 0, reduced[w] - 1) * stride[w];
    for (let row = 0; row < height; ++row)
      for (let column = 0; column < width; ++column)
        values[row * width + column] = voxels[start + row * stride[v] + column * stride[u]];
    return {values, width, height, left: 0, bottom: 0, across: size[u], up: size[v],
            offset: limits[0], factor: (limits[1] - limits[0]) / 255};
  };
  return {size, voxel, scroll, isInA, contrast, limits, plane};
}

async function showVolume() {
  const root = document.getElementById("volume");
  const volume = JSON.parse(document.getElementById("volume-data").textContent);
  const source = embeddedSource(volume, await voxelsOf(volume));
  const view = new View(source.size);
  const shown = element("div", {className: "shown"});
  const controls = element("div", {className: "controls"});
  root.replaceChildren(controls, shown);
  const planes = new Planes(shown, source, view);
  controls.append(...positionControls(view, source), ...contrastControls(planes), ...viewControls(view));
  const fit = () => planes.resize(shown.clientWidth, Infinity);  // as wide as the page
  window.addEventListener("resize", fit);
  fit();
  root.dataset.ready = "yes";
}

showVolume().catch(error => {
  document.getElementById("volume").textContent = `The volume cannot be shown: ${error.message}`;
});
