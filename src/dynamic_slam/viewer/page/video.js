// The image of the newest frame with its objects and keypoints.
"use strict";

// Of keypoints: without a landmark, holding the pose, holding it in a dynamic box, not trusted.
const KINDS = [["#8a94a1", 1], ["#5adc5a", 2.2], ["#ffdc00", 2.6], ["#ff5a4f", 1.4]];
const MOVER = "#ff5a4f", STILL = "#9fb0c3";

class VideoView {
  constructor(canvas) {
    this.canvas = canvas;
    // Where the processor draws all the same, it is ten times faster without the detour through WebGL.
    this.context = canvas.getContext("2d", {willReadFrequently: isDrawnInSoftware()});
    this.shown = -1;
    this.newest = 0;
  }

  setSize(width, height) {
    this.canvas.width = width;
    this.canvas.height = height;
    this.newest++;
    this.context.clearRect(0, 0, width, height);
  }

  // Images are decoded in their own time: an older one that is late is not drawn.
  async show(jpeg, facts, keypoints) {
    const turn = ++this.newest;
    const image = jpeg.length > 0 ? await createImageBitmap(new Blob([jpeg], {type: "image/jpeg"})) : null;
    if (turn < this.newest) return image && image.close();
    this.draw(image, facts, keypoints);
    if (image) image.close();
    this.shown = turn;
  }

  draw(image, facts, keypoints) {
    const {context, canvas} = this;
    if (image) context.drawImage(image, 0, 0, canvas.width, canvas.height);
    const unit = Math.max(1, canvas.width / 640);
    // Where movers are no keypoint is used: their boxes together are the mask.
    context.fillStyle = "rgba(255, 70, 60, 0.22)";
    context.beginPath();
    for (const box of facts.boxes) if (box.moves) context.rect(...box.at);
    context.fill("nonzero");
    KINDS.forEach(([colour, radius], kind) => {
      context.fillStyle = colour;
      context.beginPath();
      for (let i = 0; i + 3 < keypoints.length; i += 4) {
        if (keypoints[i + 2] !== kind) continue;
        context.moveTo(keypoints[i], keypoints[i + 1]);
        context.arc(keypoints[i], keypoints[i + 1], radius * unit, 0, 7);
      }
      context.fill();
    });
    for (const box of facts.boxes) this.drawBox(box, unit);
    if (facts.state === "lost") {
      context.strokeStyle = MOVER;
      context.lineWidth = 10 * unit;
      context.strokeRect(0, 0, canvas.width, canvas.height);
    }
  }

  drawBox(box, unit) {
    const {context, canvas} = this, [x, y, width, height] = box.at, colour = box.moves ? MOVER : STILL;
    context.strokeStyle = colour;
    context.lineWidth = 2.5 * unit;
    context.setLineDash(box.detected ? [] : [7 * unit, 5 * unit]);  // dashed: believed, not seen
    context.strokeRect(x, y, width, height);
    context.setLineDash([]);
    const label = `${box.name} ${box.score.toFixed(2)}${box.moves ? " moves" : " at rest"}${box.detected ? "" : ", expected"}`;
    context.font = `600 ${13 * unit}px system-ui, sans-serif`;
    const wide = context.measureText(label).width + 10 * unit, high = 18 * unit;
    const left = Math.max(0, Math.min(x, canvas.width - wide)), top = y >= high ? y - high : Math.max(0, y);
    context.fillStyle = colour;
    context.fillRect(left, top, wide, high);
    context.fillStyle = "#14080a";
    context.fillText(label, left + 5 * unit, top + 13.5 * unit);
  }
}
