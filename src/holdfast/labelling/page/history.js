// Undo without end. States are never changed in place, so that each is kept as it is, and cheap:
// what did not change is shared.

export class History {
  constructor(state) {
    this.state = state;
    this.past = [];
    this.future = [];
    this.tag = null;
  }

  /** Goes on to a new state; changes in a row with the same tag are undone as one. */
  change(state, tag = null) {
    if (tag === null || tag !== this.tag) this.past.push(this.state);
    this.tag = tag;
    this.future = [];
    this.state = state;
  }

  undo() {
    return this.step(this.past, this.future);
  }

  redo() {
    return this.step(this.future, this.past);
  }

  step(from, to) {
    if (!from.length) return false;
    to.push(this.state);
    this.state = from.pop();
    this.tag = null;
    return true;
  }
}
