// The source of a report: the recording that is in this file.

export class Report {
  constructor(app, block) {
    this.app = app;
    this.block = block;
    this.rows = undefined;
  }
  begin() {}
}
