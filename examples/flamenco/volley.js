// SPDX-License-Identifier: Apache-2.0
// A job type of Flamenco 3: frames in parts of their samples, then a merge. Goes into the folder "scripts"
// beside the manager. Workers need the add-on enabled under the name in "Add-on".

const JOB_TYPE = {
    label: "Volley, in parts",
    description: "Render parts of frames with Volley and merge them exactly",
    settings: [
        { key: "frames", type: "string", required: true,
          eval: "f'{C.scene.frame_start}-{C.scene.frame_end}'",
          description: "Frames to render, as 1,5-8" },
        { key: "tasks", type: "int32", default: 1, description: "Tasks for each frame" },
        { key: "blocks", type: "int32", default: 4,
          description: "Parts that each task writes; those finished stay when it is stopped" },
        { key: "output", type: "string", subtype: "dir_path", required: true, visible: "submission",
          description: "Folder of the parts and frames, which all workers see" },
        { key: "addon", type: "string", default: "volley", visible: "submission",
          description: "Add-on: volley, or as an extension bl_ext.user_default.volley" },
        { key: "blendfile", type: "string", required: true, visible: "web",
          description: "The file to render" },
    ],
};

function compileJob(job) {
    const settings = job.settings;
    const count = settings.tasks * settings.blocks;
    const merge = author.Task("merge", "blender");
    for (const frame of frameChunker(settings.frames, 1)) {
        for (let index = 0; index < settings.tasks; index++) {
            const first = index * settings.blocks;
            const task = author.Task(`render-${frame}-${index}`, "blender");
            task.addCommand(command(settings, ["render", "--frames", frame, "--strict",
                "--parts", `${settings.output}/parts`,
                "--blocks", `${first}-${first + settings.blocks - 1}/${count}`]));
            job.addTask(task);
            merge.addDependency(task);
        }
    }
    merge.addCommand(command(settings, ["merge", `${settings.output}/parts`,
        "--output", `${settings.output}/frame_####`]));
    job.addTask(merge);
}

// The command line of the add-on, in a Blender with the job's file.
function command(settings, line) {
    const main = `import importlib; importlib.import_module('${settings.addon}.farm.command').main()`;
    return author.Command("blender-render", {
        exe: "{blender}",
        exeArgs: "{blenderArgs}",
        argsBefore: ["--addons", settings.addon],
        blendfile: settings.blendfile,
        args: ["--python-exit-code", "1", "--python-expr", main, "--"].concat(line),
    });
}
