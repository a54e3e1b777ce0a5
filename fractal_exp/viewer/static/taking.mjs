// Taking things along: a file, or a text on the clipboard. A sandboxed frame refuses both, in silence; then what was
// asked for is shown, to be taken by hand.

/** Whether this page lies in a sandboxed frame, which has no storage and refuses downloads. */
export function isSandboxed() {
  try {
    return window.localStorage === null;
  } catch {
    return true;
  }
}

/** Let the browser save a blob under a name. */
export function download(blob, name) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 60_000);
}

/** Put a text on the clipboard; whether that was allowed. */
export async function copy(text) {
  if (isSandboxed()) return false; // to try would only be written on the console
  try {
    await navigator.clipboard.writeText(text);
    return true;
  } catch {
    return false;
  }
}

/** A blob as a data: address, which a sandboxed frame may show. */
export function asAddress(blob) {
  return new Promise((resolve, reject) => {
    const reader = new FileReader();
    reader.onload = () => resolve(reader.result);
    reader.onerror = () => reject(reader.error);
    reader.readAsDataURL(blob);
  });
}
