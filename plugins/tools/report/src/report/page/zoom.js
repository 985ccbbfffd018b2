// Zoom and pan of an image with its labels: wheel, pinch, drag, keys; a double click shows the whole image again.
"use strict";
/** Makes `canvas` zoom inside `frame`. Calls `changed` after a change of the scale. */
syntable.zoom = (frame, canvas, changed = () => {}) => {
  const MOST = 16, STEP = 1.5, PAN = 0.15, SLOP_PX = 4, PIXELATED = 4;
  // The left top corner of the canvas, in sizes of the frame.
  let scale = 1, x = 0, y = 0, shown = 1;
  const pointers = new Map();
  let moved = false;

  const apply = () => {
    x = Math.min(0, Math.max(1 - scale, x));
    y = Math.min(0, Math.max(1 - scale, y));
    Object.assign(canvas.style, { width: `${100 * scale}%`, height: `${100 * scale}%`, left: `${100 * x}%`, top: `${100 * y}%` });
    canvas.classList.toggle("pixels", scale >= PIXELATED);
    frame.classList.toggle("zoomed", scale > 1);
    frame.dataset.zoom = scale.toFixed(3);
    if (shown !== scale) {
      shown = scale;
      changed();
    }
  };
  const at = (event) => {
    const box = frame.getBoundingClientRect();
    return [(event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height];
  };
  /** Zooms by a factor; the point of the image below (u, v) stays there. */
  const by = (factor, [u, v] = [0.5, 0.5]) => {
    const next = Math.min(MOST, Math.max(1, scale * factor)), ratio = next / scale;
    [scale, x, y] = [next, u - ratio * (u - x), v - ratio * (v - y)];
    apply();
  };
  const pan = (dx, dy) => {
    [x, y] = [x + dx, y + dy];
    apply();
  };
  const reset = () => {
    [scale, x, y] = [1, 0, 0];
    apply();
  };

  frame.addEventListener("wheel", (event) => {
    // The wheel scrolls the page on from the whole image.
    if (scale === 1 && event.deltaY > 0) return;
    event.preventDefault();
    const lines = event.deltaMode === WheelEvent.DOM_DELTA_LINE ? 16 : 1;
    by(Math.exp(-event.deltaY * lines * (event.ctrlKey ? 0.01 : 0.002)), at(event));
  }, { passive: false });

  frame.addEventListener("pointerdown", (event) => {
    if (event.button !== 0) return;
    if (pointers.size === 0) moved = false;
    pointers.set(event.pointerId, at(event));
  });
  frame.addEventListener("pointermove", (event) => {
    const before = pointers.get(event.pointerId);
    if (!before) return;
    const now = at(event), box = frame.getBoundingClientRect();
    const others = [...pointers].filter(([id]) => id !== event.pointerId).map(([, place]) => place);
    if (!moved && Math.hypot((now[0] - before[0]) * box.width, (now[1] - before[1]) * box.height) < SLOP_PX) return;
    if (others.length > 0 || scale > 1) {
      moved = true;
      // From here on the movement is no click on an object.
      frame.setPointerCapture(event.pointerId);
    }
    pointers.set(event.pointerId, now);
    if (others.length > 0) {
      const [other] = others, width = (place) => Math.hypot((place[0] - other[0]) * box.width, (place[1] - other[1]) * box.height);
      by(width(now) / Math.max(1, width(before)), [(now[0] + other[0]) / 2, (now[1] + other[1]) / 2]);
      pan((now[0] - before[0]) / 2, (now[1] - before[1]) / 2);
    } else if (scale > 1) {
      pan(now[0] - before[0], now[1] - before[1]);
    }
  });
  for (const end of ["pointerup", "pointercancel"]) {
    frame.addEventListener(end, (event) => pointers.delete(event.pointerId));
  }
  frame.addEventListener("pointerleave", (event) => {
    if (!frame.hasPointerCapture(event.pointerId)) pointers.delete(event.pointerId);
  });
  frame.addEventListener("click", (event) => {
    if (moved) event.stopPropagation();
    moved = false;
  }, true);
  frame.addEventListener("dblclick", (event) => {
    event.preventDefault();
    reset();
  });

  /** Handles a key, and returns whether it was one of the zoom. */
  const key = (event) => {
    const pans = { ArrowLeft: [PAN, 0], ArrowRight: [-PAN, 0], ArrowUp: [0, PAN], ArrowDown: [0, -PAN] };
    if (event.key === "+" || event.key === "=") by(STEP);
    else if (event.key === "-") by(1 / STEP);
    else if (event.key === "0") reset();
    else if (event.shiftKey && event.key in pans && scale > 1) pan(...pans[event.key]);
    else return false;
    event.preventDefault();
    return true;
  };

  return { by, reset, key, isZoomed: () => scale > 1 };
};
