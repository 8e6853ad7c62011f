"use strict";
const cards = document.getElementById("cards");
const all = [...cards.children];
const by = document.getElementById("by");
const find = document.getElementById("find");
const count = document.getElementById("count");

const names = new Intl.Collator(undefined, { numeric: true });
const rank = (card) => {
  const text = card.dataset[by.value.replace(/_(.)/g, (_, c) => c.toUpperCase())];
  return text === "" ? Infinity : Number(text);
};

function sort() {
  const named = (a, b) => names.compare(a.dataset.name, b.dataset.name);
  // two without a figure are equal: infinity less infinity is no number
  const ranked = (a, b) => rank(a) - rank(b) || named(a, b);
  all.sort(by.value === "name" ? named : ranked);
  cards.append(...all);
}

function show() {
  const words = find.value.toLowerCase();
  let shown = 0;
  for (const card of all) {
    card.hidden = !card.dataset.name.toLowerCase().includes(words);
    shown += !card.hidden;
  }
  count.textContent = words ? `${shown} of ${all.length}` : "";
}

by.addEventListener("change", sort);
find.addEventListener("input", show);
document.getElementById("tools").addEventListener("submit", (event) => event.preventDefault());
document.getElementById("tools").hidden = all.length < 2;
