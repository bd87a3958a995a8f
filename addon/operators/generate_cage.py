# SPDX-License-Identifier: GPL-3.0-or-later
"""Generate Cage: choose bending nodes on the bones, then let the core grow a cage around the character."""

from __future__ import annotations

import bpy
from bpy.props import BoolProperty, CollectionProperty, EnumProperty, FloatProperty, IntProperty, StringProperty

from .. import caging, lifecycle, props, selection
from ..caging import current
from . import node_events, waiting
from .around_skins import AroundSkins

# Numbers never move: they are what keymaps and presets store.
PLACEMENTS = [
    ("AUTOMATIC", "Automatic", "Where limbs bend or change their girth", 0),
    ("JOINTS", "Joints", "At the joints of the armature", 1),
]

OPTIONS = ("placement", "corners", "triangles", "clearance", "tightness", "detail", "symmetry", "hull")


def _offered(_operator: bpy.types.Operator, context: bpy.types.Context, _typed: str) -> list[str]:
    """The cages that the field Like offers."""
    return [cage.name for cage in caging.cages(context.scene) if cage != context.object]


class CAGE_RIG_OT_generate_cage(AroundSkins, bpy.types.Operator):
    """Generate a cage around the selected skins, along the bones of their armature. Click on bones to add cross sections"""  # noqa: E501

    bl_idname = "cage_rig.generate_cage"
    bl_label = "Generate Cage"
    bl_options = {"REGISTER", "UNDO"}

    placement: EnumProperty(items=PLACEMENTS, name="Placement", description="Where cross sections are placed")
    corners: IntProperty(
        name="Corners", description="Vertices of the cage at each cross section", default=4, min=3, max=8
    )
    triangles: BoolProperty(name="Triangles", description="Make the cage of triangles alone, without quads")
    detail: FloatProperty(
        name="Leave Out",
        description="Limbs thinner than this share of the character's size get no branch of the cage",
        default=0.0,
        min=0.0,
        max=0.1,
        precision=3,
        step=0.1,
    )
    symmetry: BoolProperty(
        name="Symmetry", description="Give a symmetric character a symmetric cage, and edit both sides", default=True
    )
    like: StringProperty(
        name="Like",
        description="A cage that Generate Cage made, for another level of detail of this character: "
        "the new one gets its cross sections and faces, so that shape keys and weights fit both",
        search=_offered,
        options={"SKIP_SAVE"},
    )
    own_nodes: BoolProperty(
        name="Keep My Nodes", description="Use the bending nodes that were edited instead of placing them"
    )
    nodes: CollectionProperty(type=props.CageRigBendingNode, options={"HIDDEN"})

    by_hand = False  # from a menu or a button: nodes are edited first
    _run: node_events.Run | None = None

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if context.mode != "OBJECT":
            cls.poll_message_set("Generate cages in Object Mode")
            return False
        return True

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> set[str]:
        if current.shown() is not None:
            current.shown().wish = "GENERATE"  # the same button again
            return {"CANCELLED"}
        if bpy.app.background or context.window is None:
            return self.execute(context)
        self.by_hand = True
        return self._begin(context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        if self.question:  # it was answered with yes
            self.question, self.hull = "", True
            return self._begin(context)
        try:
            cage, armature, skins = self._chosen(context)
            nodes = self._own_nodes()
            with waiting.at_cursor(context) as show:
                caging.make(
                    context,
                    skins,
                    armature,
                    self._options(),
                    nodes,
                    cage=cage,
                    like=self._like(),
                    tell=self.tell,
                    watch=lambda job: show(job.share),
                )
        except (caging.GenerateError, lifecycle.BindError) as error:
            return self.say_no(error)
        return {"FINISHED"}

    def _begin(self, context: bpy.types.Context) -> set[str]:
        """Start to edit nodes; what can be repaired is asked about."""
        try:
            cage, armature, skins = self._chosen(context)
            self._run = node_events.Run(
                context, cage, armature, skins, self._options(), self._own_nodes(), self._like()
            )
        except (caging.GenerateError, lifecycle.BindError) as error:
            return self.ask(context, error)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        run = self._run
        try:
            answer = run.handle(context, event)
            if answer == {"FINISHED"}:
                self._keep(run)
                run.give_up()
                caging.finish(
                    context, run.job, run.character, run.options, run.editing.nodes, cage=run.cage, tell=self.tell
                )
                self._run = None
        except caging.GenerateError as error:
            self.cancel(context)
            return self.say_no(error)
        except BaseException:
            self.cancel(context)
            raise
        if answer == {"CANCELLED"}:
            self.cancel(context)
            self.report({"INFO"}, "No cage was generated; nothing has changed")
        return answer

    def cancel(self, _context: bpy.types.Context) -> None:
        """Leave nothing behind. Blender calls it too when it closes."""
        if self._run is not None:
            self._run.give_up()
            self._run = None

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        if self.question:
            self.draw_question()
            return
        layout.use_property_split = True
        if len(self.nodes):
            layout.prop(self, "own_nodes", text=f"Keep My {len(self.nodes)} Nodes")
        for name in OPTIONS:
            row = layout.row()
            row.enabled = name != "placement" or not self.own_nodes
            row.prop(self, name)
        layout.prop(self, "like", icon="MOD_LATTICE")
        cage = context.object
        for other in caging.suggested(context.scene, cage)[:1] if cage is not None and not self.like else []:
            layout.label(text=f"'{other.name}' has the same bones", icon="INFO")

    def _chosen(
        self, context: bpy.types.Context
    ) -> tuple[bpy.types.Object | None, bpy.types.Object | None, list[bpy.types.Object]]:
        """What is selected; a cage that is made anew lends what was not set."""
        cage, armature, skins = selection.to_generate(context)
        if cage is not None:
            given = self.properties.is_property_set
            if not given("like") and caging.like_of(cage) is not None:
                self.like = caging.like_of(cage).name
            caging.refuse_cage(cage, self._like())
            for name, value in vars(caging.options_of(cage)).items():
                if not given(name):
                    setattr(self, name, value)
            nodes = caging.nodes_of(cage)
            if not given("own_nodes") and nodes is not None:
                self._set_nodes(nodes)
        elif self.like and not self.properties.is_property_set("corners"):
            self.corners = caging.corners_of(self._like())
        return cage, armature, skins

    def _like(self) -> bpy.types.Object | None:
        if not self.like:
            return None
        if self.like not in bpy.data.objects:
            raise caging.GenerateError(f"There is no object '{self.like}' for Like; choose a generated cage, or none")
        return bpy.data.objects[self.like]

    def _options(self) -> caging.Options:
        return caging.Options(**{name: getattr(self, name) for name in OPTIONS})

    def _own_nodes(self) -> list[caging.OnBone] | None:
        return [caging.OnBone(node.name, node.position) for node in self.nodes] if self.own_nodes else None

    def _set_nodes(self, nodes: list[caging.OnBone] | None) -> None:
        self.own_nodes = nodes is not None
        self.nodes.clear()
        for node in nodes or ():
            item = self.nodes.add()
            item.name, item.position = node

    def _keep(self, run: node_events.Run) -> None:
        """What was chosen on the way is what the redo panel starts from."""
        for name in OPTIONS:
            setattr(self, name, getattr(run.options, name))
        self._set_nodes(run.editing.nodes)
