// One line for each frame: its name, light or dark, and what is wrong with it.
const rgb = text => text.match(/[\d.]+/g).map(Number);
const luminance = ([r, g, b]) => {
  const [x, y, z] = [r, g, b].map(c => (c /= 255) <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4);
  return 0.2126 * x + 0.7152 * y + 0.0722 * z;
};
// The colour behind an element: the first that is not transparent.
const behind = (view, element) => {
  for (; element; element = element.parentElement) {
    const colour = rgb(view.getComputedStyle(element).backgroundColor);
    if (colour.length < 4 || colour[3] > 0) return colour;
  }
  return [255, 255, 255];
};
const measure = frame => {
  const view = frame.contentWindow, page = frame.contentDocument, problems = [];
  const width = page.documentElement.clientWidth;
  if (page.documentElement.scrollWidth > width) problems.push('scrolls sideways');
  for (const details of page.querySelectorAll('details')) details.open = true;
  for (const element of page.body.querySelectorAll('*')) {
    const box = element.getBoundingClientRect();
    const name = element.tagName.toLowerCase();
    if (box.width && box.right > width + 0.5) problems.push(`${name} ends at ${box.right}`);
    if (name === 'td' && element.scrollWidth > element.clientWidth + 1) problems.push(`${name} overflows`);
    const text = [...element.childNodes].some(n => n.nodeType === 3 && n.data.trim());
    if (!text || name === 'script' || name === 'title') continue;
    const style = view.getComputedStyle(element);
    const inSvg = element.namespaceURI.endsWith('svg');
    const [a, b] = [rgb(inSvg ? style.fill : style.color), behind(view, element)].map(luminance);
    const contrast = (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05);
    if (contrast < 4.5) problems.push(`contrast of ${name} "${element.textContent.trim().slice(0, 20)}" is ${contrast.toFixed(2)}`);
    if (!inSvg && parseFloat(style.fontSize) < 10) problems.push(`${name} is ${style.fontSize} small`);
  }
  if (page.querySelector('rect > *, path > *, circle > *')) problems.push('shapes within shapes are not drawn');
  for (const picture of page.images)
    if (!picture.naturalWidth && picture.src.startsWith('data:')) problems.push('a picture was not shown');
  for (const entry of view.performance.getEntriesByType('resource')) problems.push(`${entry.name} was fetched`);
  const dark = luminance(rgb(view.getComputedStyle(page.body).backgroundColor)) < 0.2;
  return `${frame.title}|${dark ? 'dark' : 'light'}|${problems.join('; ')}`;
};
addEventListener('load', () => {
  const lines = [...document.querySelectorAll('iframe')].map(frame => {
    try { return measure(frame); } catch (error) { return `${frame.title}|none|${error}`; }
  });
  document.querySelectorAll('iframe, script').forEach(element => element.remove());
  document.getElementById('result').textContent = lines.join('\n');
});
