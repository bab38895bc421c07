/**
 * Changes that wait while a pointer is pressed: what moves between pressing and letting go is not clicked, since
 * the button is no longer below the pointer then.
 */

let pressed = false;
let waiting = /** @type {(() => void)[]} */ ([]);

function release() {
  pressed = false;
  const works = waiting;
  waiting = [];
  for (const work of works) work();
}

// Of a touch the focus moves with the mouse's events, which come after the pointer's own.
for (const kind of ["pointerdown", "mousedown"]) addEventListener(kind, () => { pressed = true; }, true);
for (const kind of ["click", "keydown"]) addEventListener(kind, release, true);
// No click follows where the pointer was let go elsewhere; else the click comes before the timer.
for (const kind of ["pointerup", "mouseup", "pointercancel"]) addEventListener(kind, () => setTimeout(release), true);
// Some browsers tell nothing when a scrollbar is let go.
addEventListener("pointermove", ({ buttons }) => void (buttons || release()), true);

/** Do it at once, or when the pointer is let go; a click's own work comes after it. @param {() => void} work */
export const onceReleased = (work) => void (pressed ? waiting.push(work) : work());
