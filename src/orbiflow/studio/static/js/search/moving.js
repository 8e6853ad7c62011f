/** Put children in an order; those that were there before glide to their new places (FLIP). */

const calm = matchMedia("(prefers-reduced-motion: reduce)");

/**
 * @param {HTMLElement} place
 * @param {HTMLElement[]} children
 */
export function reordered(place, children) {
  const order = /** @type {HTMLElement[]} */ ([...place.children]);
  if (order.length === children.length && order.every((child, k) => child === children[k])) return;
  const from = new Map(order.map((child) => [child, child.getBoundingClientRect()]));
  const held = /** @type {HTMLElement} */ (document.activeElement);
  order.filter((child) => !children.includes(child)).forEach((child) => child.remove());
  let next = place.firstElementChild;
  for (const child of children) { // moves as few as possible, so that what has the focus keeps it
    if (child === next) next = next.nextElementSibling;
    else place.insertBefore(child, next);
  }
  if (held && place.contains(held) && document.activeElement !== held) {
    held.focus({ preventScroll: true });
  }
  if (calm.matches) return;
  for (const child of children) {
    const was = from.get(child);
    const is = child.getBoundingClientRect();
    if (!was) {
      child.animate([{ opacity: 0, transform: "scale(0.97)" }, { opacity: 1, transform: "none" }], {
        duration: 350,
        easing: "ease-out",
      });
    } else if (Math.abs(was.left - is.left) + Math.abs(was.top - is.top) > 1) {
      const shift = `translate(${was.left - is.left}px, ${was.top - is.top}px) scale(${
        was.width / is.width
      })`;
      child.animate([{ transformOrigin: "0 0", transform: shift }, {
        transformOrigin: "0 0",
        transform: "none",
      }], { duration: 600, easing: "cubic-bezier(0.2, 0.7, 0.2, 1)" });
    }
  }
}
