/** A photo from the computer's own camera. */

import { button, dialog, h, stack } from "../dom.js";

/** Show what the camera sees; resolves with a PNG, or undefined. */
export async function photograph() {
  const video = h("video", { autoplay: true, playsinline: true, muted: true, class: "seen" });
  const said = h(
    "p",
    { class: "soft", role: "status" },
    "Hold the animal before a plain background.",
  );
  let stream = null;
  const shot = await dialog("Take a photo", (close) => {
    const shutter = button("Take the photo", () => {
      const canvas = h("canvas", { width: video.videoWidth, height: video.videoHeight });
      canvas.getContext("2d").drawImage(video, 0, 0);
      canvas.toBlob(close, "image/png");
    }, { kind: "primary", image: "camera", disabled: true });
    video.addEventListener("loadedmetadata", () => {
      shutter.disabled = false;
    });
    navigator.mediaDevices.getUserMedia({ video: { width: 1280 } }).then(
      (found) => {
        stream = found;
        video.srcObject = found;
      },
      () => {
        said.textContent =
          "The camera cannot be used. Allow it in your browser, or choose a picture.";
      },
    );
    return stack(video, said, h("footer", shutter));
  });
  /** @type {MediaStream | null} */ (stream)?.getTracks().forEach((track) => track.stop());
  return shot;
}
