/** A link that carries a tile: it becomes a project of its own, and is proved again. */

/** @type {Show} */
export async function show(_root, { api, navigate }) {
  const text = location.hash.replace(/^#\/open\//, "");
  const { id } = await api.post("projects/shared", { text });
  const { tiles } = await api.get(`projects/${id}`);
  navigate(`p/${id}/t/${tiles[0].id}`, { replace: true });
}
