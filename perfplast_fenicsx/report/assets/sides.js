// Small pictures of the bodies from other sides, printed beside the large one.

const SIDES = [["oblique", -60, 25], ["from −y", -90, 0], ["from +x", 0, 0], ["from above", -90, 90]];
const SIDE_PIXELS = [560, 420];
const REST = 300; // ms without a change until they are redrawn

class Sides {
  /** Make a button for each picture, which turns the large picture to its side. */
  constructor(viewer, place) {
    this.viewer = viewer;
    this.pictures = SIDES.map(([words, ...angles]) => {
      const image = Object.assign(document.createElement("img"), { alt: "" });
      const button = Object.assign(document.createElement("button"), { type: "button" });
      button.append(image, words);
      button.addEventListener("click", () => {
        viewer.camera.reset(...angles);
        viewer.redraw();
      });
      place.append(button);
      return { image, angles };
    });
    window.addEventListener("beforeprint", () => this.draw());
  }

  /** Draw the pictures when nothing has changed for a while. */
  later() {
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.draw(), REST);
  }

  draw() {
    const { canvas, drawing, look, camera } = this.viewer;
    const { width, height } = canvas;
    [canvas.width, canvas.height] = SIDE_PIXELS;
    for (const { image, angles } of this.pictures) {
      drawing.draw({ ...look, camera: camera.seenFrom(...angles), picked: -1 });
      image.src = canvas.toDataURL();
    }
    [canvas.width, canvas.height] = [width, height];
    drawing.draw(look);
  }
}
