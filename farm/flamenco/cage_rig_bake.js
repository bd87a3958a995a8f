// SPDX-License-Identifier: GPL-3.0-or-later
// A job type for Flamenco 3: bake the rigs of a .blend to point caches, in chunks of frames, and join them.

const JOB_TYPE = {
    label: "Cage Rig Bake",
    description: "Bake Cage Rig characters to point caches (PC2) that need no add-on",
    settings: [
        {
            key: "frames", type: "string", required: true,
            eval: "f'{C.scene.frame_start}-{C.scene.frame_end}'",
            evalInfo: { showLinkButton: true, description: "Scene frame range" },
            description: "First and last frame, both included. Example: '1-48'",
        },
        {
            key: "chunk_size", type: "int32", default: 24,
            description: "Frames of one task. Opening the file is paid once a task",
            visible: "submission",
        },
        {
            key: "output_dir", type: "string", subtype: "dir_path", required: true,
            description: "The folder for the point caches; the tasks' parts are in 'parts' in it",
            visible: "submission",
        },
        {
            key: "rig", type: "string", default: "",
            description: "Only the rig of this rest cage object; empty: every rig of the file",
            visible: "submission",
        },
        {
            key: "blendfile", type: "string", required: true,
            description: "Path of the .blend file", visible: "web",
        },
    ],
};

function compileJob(job) {
    const settings = job.settings;
    if (!/^\d+(-\d+)?$/.test(settings.frames)) {
        throw new Error(`'${settings.frames}' is no range of frames; write it as 1-48`);
    }
    const parts = path.join(settings.output_dir, "parts");
    const merge = author.Task("merge", "blender");
    merge.addCommand(cageRig("merge", parts, ["--out", settings.output_dir]));
    for (const frames of frameChunker(settings.frames, settings.chunk_size)) {
        const bake = author.Task(`bake-${frames}`, "blender");
        const rig = settings.rig ? ["--rig", settings.rig] : [];
        bake.addCommand(cageRig("bake", settings.blendfile, [
            "--to", "pc2", "--frames", frames, "--out", path.join(parts, frames), ...rig,
        ]));
        merge.addDependency(bake);
        job.addTask(bake);
    }
    job.addTask(merge);
}

// A call of the extension's command line by the farm's Blender. The worker runs
// {exe} {exeArgs} {argsBefore} {blendfile} {args}, which is just what a command with its first file is.
function cageRig(command, file, args) {
    return author.Command("blender-render", {
        exe: "{blender}",
        exeArgs: "{blenderArgs}",
        argsBefore: ["--command", "cage_rig", command],
        blendfile: file,
        args: args,
    });
}
