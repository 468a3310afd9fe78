"use strict";
// Shows linked planes of a volume on canvases. The report of a run and `tomofield view` share this
// file. They differ in their sources, which hand out the values.
//
// Positions are [x, y, z] in Å from the lower corner of the volume, or in voxels if the voxel size
// is not known. A source has
//   size      the extent of the volume, [x, y, z]
//   voxel     the side of a voxel of the file
//   scroll    the distance of two planes that differ, [x, y, z]
//   isInA     says whether lengths are in Å
//   contrast  the values that are black and white at first
//   limits    the range of the contrast sliders
//   plane(request)   a promise of a picture
// A request has the axes u (to the right) and v (upwards) of a plane, a point of it ("centre"), the
// pixels ("width", "height") and the length of a pixel ("step"). A picture has
//   values, width, height   row 0 is at the bottom
//   left, bottom            the distances of its lower left corner from the origin, along u and v
//   across, up              its extent along u and v
//   offset, factor          value = offset + factor · values[i]

const AXES = {
  xy: {title: "XY", u: [1, 0, 0], v: [0, 1, 0], w: [0, 0, 1], normal: 2, colour: "#5aa9ff"},
  zy: {title: "YZ", u: [0, 0, 1], v: [0, 1, 0], w: [1, 0, 0], normal: 0, colour: "#3ccf78"},
  xz: {title: "XZ", u: [1, 0, 0], v: [0, 0, 1], w: [0, 1, 0], normal: 1, colour: "#ffa63d"},
};
const BACKGROUND = "#101214";

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const along = (p, direction, length) => p.map((value, i) => value + direction[i] * length);
const clamp = (value, low, high) => Math.min(Math.max(value, low), high);

// Makes an element with attributes and children.
function element(name, attributes = {}, ...children) {
  const made = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) {
    if (key.startsWith("on")) made.addEventListener(key.slice(2), value);
    else if (key in made && key !== "style") made[key] = value;
    else made.setAttribute(key, value);
  }
  made.append(...children);
  return made;
}

// Writes a number with four significant digits.
function short(value) {
  if (value === 0) return "0";
  const size = Math.abs(value);
  return size >= 1e5 || size < 1e-3 ? value.toExponential(2) : String(Number(value.toPrecision(4)));
}

function lengthText(length, isInA) {
  if (!isInA) return `${short(length)} px`;
  return length >= 10000 ? `${short(length / 10000)} µm`
      : length >= 10 ? `${short(length / 10)} nm` : `${short(length)} Å`;
}

// Returns the longest round length, 1, 2 or 5 times a power of ten, up to a length.
function roundLength(longest) {
  const decade = 10 ** Math.floor(Math.log10(longest));
  return decade * (longest >= 5 * decade ? 5 : longest >= 2 * decade ? 2 : 1);
}

// Holds what is seen, which all volumes of a page share: the point in which the planes meet, the
// centre of the panels, and the zoom.
class View {
  constructor(size) {
    this.size = size;
    this.listeners = [];
    this.isCrossed = true;
    this.angles = [0, 0, 0];
    this.reset();
  }
  reset() {
    this.position = this.size.map(length => length / 2);
    this.centre = [...this.position];
    this.zoom = 1;
    this.changed();
  }
  moveTo(position) {
    this.position = position.map((value, i) => clamp(value, 0, this.size[i] * (1 - 1e-9)));
    this.changed();
  }
  // Zooms so that a point stays where it is on the screen.
  zoomAt(point, factor) {
    const zoom = clamp(this.zoom * factor, 1, 200);
    const kept = this.zoom / zoom;
    this.zoom = zoom;
    this.panTo(this.centre.map((value, i) => point[i] + (value - point[i]) * kept));
  }
  panTo(centre) {
    this.centre = centre.map((value, i) => {
      const half = this.size[i] / 2 / this.zoom;
      return clamp(value, half, this.size[i] - half);
    });
    this.changed();
  }
  changed() {
    for (const listener of this.listeners) listener();
  }
}

// A canvas with one plane of a volume.
class Panel {
  constructor(planes, name) {
    this.planes = planes;
    this.name = name;
    this.buffer = document.createElement("canvas");
    this.canvas = element("canvas", {
      className: "plane", tabIndex: 0, title: this.axes.title,
      onwheel: event => this.onWheel(event), onkeydown: event => this.onKey(event),
      onpointerdown: event => this.onDown(event), onpointermove: event => this.onMove(event),
      onpointerup: event => this.onUp(event), onpointerleave: () => planes.tell("")});
    this.canvas.dataset.plane = name;
    this.canvas.setAttribute("role", "img");
    this.canvas.setAttribute("aria-label", `${this.axes.title} plane`);
  }
  get axes() { return AXES[this.name] ?? obliqueAxes(this.planes.view.angles); }
  get view() { return this.planes.view; }
  get scale() { return this.planes.fit * this.view.zoom; }  // CSS pixels a unit of length

  resize(width, height) {
    this.width = Math.max(1, Math.round(width));
    this.height = Math.max(1, Math.round(height));
    this.ratio = window.devicePixelRatio || 1;
    this.canvas.width = Math.round(this.width * this.ratio);
    this.canvas.height = Math.round(this.height * this.ratio);
    this.canvas.style.width = `${this.width}px`;
    this.canvas.style.height = `${this.height}px`;
  }

  // Returns the point of the plane that is in the middle of the canvas.
  centre() {
    const {position, centre} = this.view, {w} = this.axes;
    return along(centre, w, dot(position, w) - dot(centre, w));
  }
  toScreen(a, b) {
    const centre = this.centre(), {u, v} = this.axes;
    return [this.width / 2 + (a - dot(centre, u)) * this.scale,
            this.height / 2 - (b - dot(centre, v)) * this.scale];
  }
  pointAt(event) {
    const {u, v} = this.axes;
    const right = (event.offsetX - this.width / 2) / this.scale;
    const up = (this.height / 2 - event.offsetY) / this.scale;
    return along(along(this.centre(), u, right), v, up);
  }

  // Asks for the picture that belongs to the view, one at a time.
  async refresh() {
    const {u, v} = this.axes;
    const request = {name: this.name, u, v, centre: this.centre(), angles: this.view.angles,
                     width: this.canvas.width, height: this.canvas.height,
                     step: 1 / (this.scale * this.ratio)};
    const key = JSON.stringify(request);
    this.canvas.dataset.settled = !this.isBusy && key === this.shown ? "yes" : "no";
    if (this.isBusy || key === this.shown) return;
    this.isBusy = true;
    try {
      this.picture = await this.planes.source.plane(request);
      this.colour();
      this.planes.fail("");
    } catch (error) {
      this.planes.fail(error.message);
    }
    this.shown = key;
    this.isBusy = false;
    this.draw();
    this.refresh();
  }

  // Turns the values of the picture into greys.
  colour() {
    if (!this.picture) return;
    const {values, width, height, offset, factor} = this.picture;
    const [black, white] = this.planes.contrast;
    const slope = 255 * factor / (white - black || 1), start = 255 * (offset - black) / (white - black || 1);
    const image = new ImageData(width, height);
    const pixels = new Uint32Array(image.data.buffer);
    for (let y = 0; y < height; ++y) {
      let to = (height - 1 - y) * width;
      for (let from = y * width; from < (y + 1) * width; ++from) {
        const grey = clamp(start + slope * values[from], 0, 255) & 255;
        pixels[to++] = Number.isNaN(values[from]) ? 0 : 0xff000000 | grey << 16 | grey << 8 | grey;
      }
    }
    this.buffer.width = width;
    this.buffer.height = height;
    this.buffer.getContext("2d").putImageData(image, 0, 0);
  }

  draw() {
    const context = this.canvas.getContext("2d");
    context.setTransform(this.ratio, 0, 0, this.ratio, 0, 0);
    context.fillStyle = BACKGROUND;
    context.fillRect(0, 0, this.width, this.height);
    if (this.picture) this.drawPicture(context);
    if (this.view.isCrossed) this.drawCross(context);
    this.drawName(context);
    if (this.name === "xy" || this.name === "oblique") this.drawScaleBar(context);
  }
  drawPicture(context) {
    const {left, bottom, across, up, width} = this.picture;
    const [x, y] = this.toScreen(left, bottom + up);
    const wide = across * this.scale;
    context.imageSmoothingEnabled = wide < 3 * width;
    context.imageSmoothingQuality = "high";
    context.drawImage(this.buffer, x, y, wide, up * this.scale);
  }
  drawCross(context) {
    const {position} = this.view, {u, v, colour} = this.axes;
    const [x, y] = this.toScreen(dot(position, u), dot(position, v));
    const line = (of, ...ends) => {
      context.strokeStyle = of;
      context.globalAlpha = 0.75;
      context.beginPath();
      context.moveTo(ends[0], ends[1]);
      context.lineTo(ends[2], ends[3]);
      context.stroke();
      context.globalAlpha = 1;
    };
    const colourOf = direction =>
        Object.values(AXES).find(other => dot(other.w, direction) === 1)?.colour ?? colour;
    line(colourOf(u), x, 0, x, this.height);
    line(colourOf(v), 0, y, this.width, y);
  }
  drawName(context) {
    const {title, colour} = this.axes;
    context.font = "600 13px system-ui, sans-serif";
    context.textAlign = "left";
    outlined(context, title, 6, 17, colour);
  }
  drawScaleBar(context) {
    const {isInA} = this.planes.source;
    const length = roundLength(Math.min(160, 0.4 * this.width) / this.scale);
    const wide = length * this.scale, x = 10, y = this.height - 12;
    context.fillStyle = "#000";
    context.fillRect(x - 1, y - 1, wide + 2, 6);
    context.fillStyle = "#fff";
    context.fillRect(x, y, wide, 4);
    context.font = "600 12px system-ui, sans-serif";
    context.textAlign = "left";
    outlined(context, lengthText(length, isInA), x, y - 6, "#fff");
  }

  // Moves the plane along its normal, in steps that show something new.
  scroll(steps) {
    const {w} = this.axes;
    const step = Math.abs(dot(this.planes.source.scroll, w.map(Math.abs)));
    this.view.moveTo(along(this.view.position, w, steps * step));
  }
  onWheel(event) {
    event.preventDefault();
    if (event.ctrlKey || event.metaKey) {
      this.view.zoomAt(this.pointAt(event), event.deltaY < 0 ? 1.25 : 0.8);
      return;
    }
    this.turned = (this.turned ?? 0) - event.deltaY * (event.deltaMode ? 40 : 1);
    const steps = Math.trunc(this.turned / 40);  // a notch of a mouse's wheel has at least 40
    if (steps === 0) return;
    this.turned = 0;
    this.scroll(Math.sign(steps) * (event.shiftKey ? 10 : 1));
  }
  onKey(event) {
    const steps = {ArrowUp: 1, ArrowRight: 1, ArrowDown: -1, ArrowLeft: -1, PageUp: 10, PageDown: -10};
    if (event.key in steps) this.scroll(steps[event.key]);
    else if (event.key === "+" || event.key === "=") this.view.zoomAt(this.view.position, 1.25);
    else if (event.key === "-") this.view.zoomAt(this.view.position, 0.8);
    else if (event.key === "0") this.view.reset();
    else return;
    event.preventDefault();
  }
  onDown(event) {
    this.canvas.focus({preventScroll: true});
    this.canvas.setPointerCapture(event.pointerId);
    this.grip = {x: event.offsetX, y: event.offsetY, centre: this.view.centre, isDragged: false};
  }
  onMove(event) {
    const point = this.pointAt(event);
    if (!this.grip) return this.planes.tell(this.readout(point));
    const dx = event.offsetX - this.grip.x, dy = event.offsetY - this.grip.y;
    if (Math.hypot(dx, dy) > 3) this.grip.isDragged = true;
    if (!this.grip.isDragged) return;
    const {u, v} = this.axes;
    this.view.panTo(along(along(this.grip.centre, u, -dx / this.scale), v, dy / this.scale));
  }
  onUp(event) {
    if (this.grip && !this.grip.isDragged) this.view.moveTo(this.pointAt(event));
    this.grip = null;
  }
  // Says where the pointer is, and the value there.
  readout(point) {
    const {voxel, size} = this.planes.source;
    if (point.some((value, i) => value < 0 || value >= size[i])) return "";
    const at = point.map(value => Math.floor(value / voxel) + 1).join(", ");
    if (!this.picture) return `voxel ${at}`;
    const {values, width, height, left, bottom, across, up, offset, factor} = this.picture;
    const {u, v} = this.axes;
    const column = Math.floor((dot(point, u) - left) / across * width);
    const row = Math.floor((dot(point, v) - bottom) / up * height);
    const value = offset + factor * values[row * width + column];
    return `voxel ${at}: ${Number.isFinite(value) ? short(value) : "–"}`;
  }
}

// Writes a text that is readable on any grey.
function outlined(context, text, x, y, colour) {
  context.lineWidth = 3;
  context.strokeStyle = "#000a";
  context.strokeText(text, x, y);
  context.fillStyle = colour;
  context.fillText(text, x, y);
  context.lineWidth = 1;
}

// Returns the axes of a plane that is turned about x, then y, then z by angles in degrees.
function obliqueAxes(angles) {
  const [a, b, c] = angles.map(angle => angle * Math.PI / 180);
  const turn = ([x, y, z]) => {
    [y, z] = [y * Math.cos(a) - z * Math.sin(a), y * Math.sin(a) + z * Math.cos(a)];
    [x, z] = [x * Math.cos(b) + z * Math.sin(b), -x * Math.sin(b) + z * Math.cos(b)];
    return [x * Math.cos(c) - y * Math.sin(c), x * Math.sin(c) + y * Math.cos(c), z];
  };
  return {title: "oblique", u: turn([1, 0, 0]), v: turn([0, 1, 0]), w: turn([0, 0, 1]),
          colour: "#ff7bd0"};
}

// A labelled slider with the text of its value.
class Slider {
  constructor(label, options, onInput) {
    this.text = element("output");
    this.input = element("input", {type: "range", ...options,
                                   oninput: () => onInput(Number(this.input.value))});
    this.input.setAttribute("aria-label", label);
    this.row = element("label", {className: "slider"}, element("span", {}, label), this.input, this.text);
  }
  show(value, text) {
    this.input.value = value;
    this.text.value = text;
  }
}

// Three planes of one volume at right angles, and its contrast.
class Planes {
  constructor(root, source, view) {
    this.source = source;
    this.view = view;
    this.contrast = [...source.contrast];
    this.panels = ["xy", "zy", "xz"].map(name => new Panel(this, name));
    this.status = element("p", {className: "status"});
    this.grid = element("div", {className: "panels"}, ...this.panels.map(panel => panel.canvas));
    root.append(this.grid, this.status);
    view.listeners.push(() => this.refresh());
  }
  // Adds a panel whose plane may have any direction, or removes it.
  setOblique(isShown) {
    this.oblique?.canvas.remove();
    this.oblique = isShown ? new Panel(this, "oblique") : null;
    if (this.oblique) this.grid.append(this.oblique.canvas);
  }
  // Fits panels of the size of the view into a rectangle of CSS pixels.
  resize(width, height) {
    const [x, y, z] = this.view.size, gap = 6;
    const across = x + z + (this.oblique ? x : 0);
    this.fit = Math.min((width - 2 * gap) / across, (height - gap) / (y + z));
    this.panels[0].resize(x * this.fit, y * this.fit);
    this.panels[1].resize(z * this.fit, y * this.fit);
    this.panels[2].resize(x * this.fit, z * this.fit);
    this.oblique?.resize(x * this.fit, y * this.fit);
    this.refresh();
  }
  refresh() {
    if (!this.fit) return;
    for (const panel of this.allPanels()) {
      panel.draw();
      panel.refresh();
    }
  }
  allPanels() { return this.oblique ? [...this.panels, this.oblique] : this.panels; }
  setContrast(black, white) {
    this.contrast = [black, white];
    for (const panel of this.allPanels()) {
      panel.colour();
      panel.draw();
    }
    this.showContrast?.();
  }
  tell(text) { this.status.textContent = this.failure || text; }
  fail(text) {
    this.failure = text;
    this.status.classList.toggle("failed", text !== "");
    if (text) this.tell("");
  }
}

// Returns the sliders that move the planes.
function positionControls(view, source) {
  const names = ["x", "y", "z"];
  const sliders = [2, 1, 0].map(axis => {
    const slider = new Slider(`${names[axis]} (${["YZ", "XZ", "XY"][axis]})`,
        {min: 0, max: Math.round(source.size[axis] / source.scroll[axis]) - 1, step: 1}, index => {
          const position = [...view.position];
          position[axis] = (index + 0.5) * source.scroll[axis];
          view.moveTo(position);
        });
    slider.input.dataset.axis = names[axis];
    slider.axis = axis;
    return slider;
  });
  const show = () => {
    for (const slider of sliders) {
      const at = view.position[slider.axis];
      const section = Math.floor(at / source.voxel) + 1;
      const count = Math.round(source.size[slider.axis] / source.voxel);
      slider.show(Math.floor(at / source.scroll[slider.axis]), `${section} of ${count}`);
    }
  };
  view.listeners.push(show);
  show();
  return sliders.map(slider => slider.row);
}

// Returns the sliders of a volume's contrast.
function contrastControls(planes, suffix = "") {
  const [low, high] = planes.source.limits;
  const options = {min: low, max: high, step: (high - low) / 500};
  const black = new Slider("black" + suffix, options, value => planes.setContrast(value, planes.contrast[1]));
  const white = new Slider("white" + suffix, options, value => planes.setContrast(planes.contrast[0], value));
  planes.showContrast = () => {
    black.show(planes.contrast[0], short(planes.contrast[0]));
    white.show(planes.contrast[1], short(planes.contrast[1]));
  };
  planes.showContrast();
  const button = (text, onclick) => element("button", {type: "button", onclick}, text);
  return [black.row, white.row, element("p", {className: "buttons"},
      button("invert", () => planes.setContrast(planes.contrast[1], planes.contrast[0])),
      button("reset contrast", () => planes.setContrast(...planes.source.contrast)))];
}

// Returns the buttons that zoom.
function viewControls(view) {
  const button = (text, onclick) => element("button", {type: "button", onclick}, text);
  const cross = element("input", {type: "checkbox", checked: true, onchange: () => {
    view.isCrossed = cross.checked;
    view.changed();
  }});
  return [element("p", {className: "buttons"},
      button("zoom in", () => view.zoomAt(view.position, 1.5)),
      button("zoom out", () => view.zoomAt(view.position, 1 / 1.5)),
      button("whole volume", () => view.reset())),
      element("label", {className: "check"}, cross, " lines where the planes cross")];
}
