/** Put children in an order, moving as few as possible: what has the focus keeps it. */

/** @param {HTMLElement} place @param {HTMLElement[]} children */
export function reordered(place, children) {
  const held = /** @type {HTMLElement} */ (document.activeElement);
  [...place.children].forEach((child) => {
    if (!children.includes(/** @type {HTMLElement} */ (child))) child.remove();
  });
  let next = place.firstElementChild;
  for (const child of children) {
    if (child === next) next = next.nextElementSibling;
    else place.insertBefore(child, next);
  }
  if (held && place.contains(held)) held.focus({ preventScroll: true });
}
