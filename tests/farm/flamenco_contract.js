// SPDX-License-Identifier: GPL-3.0-or-later
// What Flamenco's Manager documents that a job compiler script gets; compiles a job and prints it as JSON.
"use strict";
const fs = require("fs");
const vm = require("vm");
const posix = require("path").posix;

const TASK_TYPES = ["blender", "ffmpeg", "file-management", "misc"];
const COMMANDS = { "blender-render": { exe: "string", exeArgs: "string", argsBefore: "list", blendfile: "string", args: "list" } };
const SETTING_TYPES = ["string", "int32", "float", "bool"];
const SUBTYPES = ["file_path", "dir_path", "file_name", "hashed_file_path"];
const VISIBLE = ["visible", "hidden", "submission", "web"];
const KEYS = ["key", "type", "subtype", "required", "default", "description", "eval", "evalInfo", "visible", "editable", "choices", "propargs"];

function need(truth, what) { if (!truth) throw new Error(`contract: ${what}`); }

const author = {
    Task(name, type) {
        need(typeof name === "string" && TASK_TYPES.includes(type), `task '${name}' of type '${type}'`);
        return {
            name, type, commands: [], dependencies: [],
            addCommand(command) { this.commands.push(command); },
            addDependency(task) { need(task.commands, "a dependency is a task"); this.dependencies.push(task); },
        };
    },
    Command(name, parameters) {
        const known = COMMANDS[name];
        need(known, `the worker knows no command '${name}'`);
        for (const [key, value] of Object.entries(parameters)) {
            need(key in known, `'${name}' takes no '${key}'`);
            const fits = known[key] === "list" ? Array.isArray(value) && value.every(one => typeof one === "string") : typeof value === known[key];
            need(fits, `'${key}' of '${name}'`);
        }
        return { name, parameters };
    },
};

// "1-10" in pieces of at most `size` frames; whole numbers from 0, as the Manager's.
function frameChunker(range, size) {
    need(Number.isInteger(size) && size >= 1, "a chunk has at least one frame");
    const [first, last] = (range.includes("-") ? range.split("-") : [range, range]).map(Number);
    const found = [];
    for (let a = first; a <= last; a += size) {
        const b = Math.min(a + size - 1, last);
        found.push(a === b ? `${a}` : `${a}-${b}`);
    }
    return found;
}

const [, , script, settings] = process.argv;
const job = { type: "cage-rig-bake", name: "test", priority: 50, created: new Date(), settings: JSON.parse(settings), metadata: {}, tasks: [],
    addTask(task) { need(task.commands.length, `task '${task.name}' does nothing`); this.tasks.push(task); } };
const world = vm.createContext({ author, frameChunker, path: posix, print: console.error, job });
vm.runInContext(fs.readFileSync(script, "utf8") + "\nglobalThis.found = JOB_TYPE; compileJob(job);", world);
for (const setting of world.found.settings) {
    need(SETTING_TYPES.includes(setting.type), `setting '${setting.key}' has type '${setting.type}'`);
    need(setting.subtype === undefined || SUBTYPES.includes(setting.subtype), `setting '${setting.key}' has a subtype`);
    need(setting.visible === undefined || VISIBLE.includes(setting.visible), `setting '${setting.key}' is visible somewhere`);
    Object.keys(setting).forEach(key => need(KEYS.includes(key), `setting '${setting.key}' has '${key}'`));
}
const tasks = job.tasks.map(task => ({ name: task.name, type: task.type, commands: task.commands, after: task.dependencies.map(other => other.name) }));
console.log(JSON.stringify({ label: world.found.label, settings: world.found.settings, tasks }));
