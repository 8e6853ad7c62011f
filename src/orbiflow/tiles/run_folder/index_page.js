"use strict";
// opened from a disk, the page knows where its folder is now
if (location.protocol === "file:") {
  const path = decodeURIComponent(location.pathname).replace(/\/[^/]*$/, "").replace(/^\/([A-Z]:)/i, "$1");
  const quoted = /^[\w@%+=:,./-]+$/.test(path) ? path : `'${path.replaceAll("'", `'"'"'`)}'`;
  for (const folder of document.querySelectorAll(".folder")) folder.textContent = quoted;
}

// one set of commands, for the tile that is chosen, also by the address
const choices = [...document.querySelectorAll(".choice input")];
function choose() {
  const folder = choices.find((choice) => choice.checked)?.value;
  if (!folder) return;
  const forced = "force" in document.getElementById(folder).dataset;
  for (const place of document.querySelectorAll(".make .chosen")) place.textContent = folder;
  for (const place of document.querySelectorAll(".make .force")) place.textContent = forced ? " --force" : "";
}
function follow() {
  const meant = choices.find((choice) => `#${choice.value}` === location.hash);
  if (meant) meant.checked = true;
  choose();
}
for (const choice of choices) choice.addEventListener("change", choose);
addEventListener("hashchange", follow);
follow();

for (const place of document.querySelectorAll(".command")) {
  const button = document.createElement("button");
  button.textContent = "Copy";
  button.addEventListener("click", async () => {
    try {
      await navigator.clipboard.writeText(place.querySelector("code").textContent);
      button.textContent = "Copied";
    } catch {
      button.textContent = "Not copied: select the text";
    }
    setTimeout(() => { button.textContent = "Copy"; }, 2000);
  });
  place.append(button);
}
