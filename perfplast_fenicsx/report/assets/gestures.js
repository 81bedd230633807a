// Mouse, fingers and keys on the picture.

const CLICK = 5; // pixels that the pointer may move during a click

/** Turn, move, zoom and pick by pointers. */
function followPointers(viewer, onPick) {
  const { canvas, camera } = viewer;
  const pointers = new Map();
  let moved = 0;
  const size = () => [canvas.clientWidth, canvas.clientHeight];
  const shift = (dx, dy) => camera.pan((2 * dx) / size()[1], (-2 * dy) / size()[1], ...size());
  const spread = () => {
    const [a, b] = [...pointers.values()];
    return Math.hypot(a.x - b.x, a.y - b.y) || 1;
  };
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    pointers.set(event.pointerId, { x: event.offsetX, y: event.offsetY });
    if (pointers.size === 1) moved = 0;
  });
  canvas.addEventListener("pointermove", (event) => {
    const before = pointers.get(event.pointerId);
    if (!before) return;
    const now = { x: event.offsetX, y: event.offsetY };
    const [dx, dy] = [now.x - before.x, now.y - before.y];
    const apart = pointers.size === 2 ? spread() : 0;
    pointers.set(event.pointerId, now);
    moved += Math.abs(dx) + Math.abs(dy);
    if (pointers.size === 2) {
      camera.magnify(spread() / apart);
      shift(dx / 2, dy / 2);
    } else if (event.shiftKey || event.buttons === 2 || camera.plane) {
      shift(dx, dy);
    } else {
      camera.orbit(0.5 * dx, 0.5 * dy);
    }
    viewer.turned();
  });
  canvas.addEventListener("pointerup", (event) => {
    if (pointers.size === 1 && moved < CLICK) onPick(viewer.pick(event.offsetX, event.offsetY));
    pointers.delete(event.pointerId);
  });
  canvas.addEventListener("pointercancel", (event) => pointers.delete(event.pointerId));
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  canvas.addEventListener("wheel", (event) => {
    if (document.activeElement !== canvas) return; // the page scrolls
    event.preventDefault();
    camera.magnify(Math.exp(-0.001 * event.deltaY));
    viewer.turned();
  }, { passive: false });
}

/** Turn, move and zoom by keys; `others` contains the actions of further keys. */
function followKeys(viewer, others) {
  const { canvas, camera } = viewer;
  const arrows = {
    ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1],
  };
  canvas.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    const arrow = arrows[event.key];
    const act = others[event.key.toLowerCase()];
    if (arrow && (event.shiftKey || camera.plane)) {
      camera.pan(0.1 * arrow[0], 0.1 * arrow[1], canvas.clientWidth, canvas.clientHeight);
    } else if (arrow) {
      camera.orbit(10 * arrow[0], -10 * arrow[1]);
    } else if (event.key === "+" || event.key === "=") {
      camera.magnify(1.2);
    } else if (event.key === "-") {
      camera.magnify(1 / 1.2);
    } else if (event.key === "0") {
      camera.reset();
    } else if (act) {
      act();
    } else {
      return;
    }
    event.preventDefault();
    viewer.turned();
  });
}
