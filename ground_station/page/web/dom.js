/** Small helpers for elements; text from the fleet never becomes markup. */

/** First element that fits a selector. */
export const one = (selector, within = document) => within.querySelector(selector);

/** A new element with properties and children. */
export const make = (tag, properties = {}, ...children) => {
  const element = Object.assign(document.createElement(tag), properties);
  element.append(...children);
  return element;
};

/** Replace text and class where they differ: nothing is laid out that has not changed. */
export const write = (element, text, className = element.className) => {
  if (element.textContent !== text) element.textContent = text;
  if (element.className !== className) element.className = className;
};

/** Offer choices in a list, if they have changed. */
export const offer = (select, choices, empty = null) => {
  const wanted = [...(empty === null ? [] : [['', empty]]), ...choices.map((one) => (Array.isArray(one) ? one : [one, one]))];
  if (select.dataset.offered === JSON.stringify(wanted)) return;
  select.dataset.offered = JSON.stringify(wanted);
  select.replaceChildren(...wanted.map(([value, text]) => new Option(text, value)));
};

/** Show a value in a control, unless the user is about to change it. */
export const choose = (control, value) => {
  if (document.activeElement !== control && control.value !== String(value)) control.value = value;
};

/** Colours of the present theme by name, as in style.css. */
export const theme = () => {
  const style = getComputedStyle(document.documentElement);
  return (name) => style.getPropertyValue(`--${name}`).trim();
};
