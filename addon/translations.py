# SPDX-License-Identifier: GPL-3.0-or-later
"""The panels' words in other languages. Terms are those of Blender's own translations."""

from __future__ import annotations

import bpy

LANGUAGES = ("de_DE", "fr_FR", "es")
# English: German, French, Spanish. Buttons of operators are looked up in a context of their own.
LABELS: dict[str, tuple[str, str, str]] = {
    "Select skins, armature and cage:": (
        "Häute, Armatur und Käfig auswählen:",
        "Sélectionner peaux, armature et cage :",
        "Seleccionar pieles, esqueleto y jaula:",
    ),
    "Select skins and armature:": (
        "Häute und Armatur auswählen:",
        "Sélectionner peaux et armature :",
        "Seleccionar pieles y esqueleto:",
    ),
    "Click on bones to add nodes": (
        "Auf Knochen klicken, um Knoten hinzuzufügen",
        "Cliquer sur les os pour ajouter des nœuds",
        "Hacer clic en los huesos para agregar nodos",
    ),
    "This edit is not keyed": (
        "Diese Änderung hat keinen Schlüssel",
        "Cette modification n'a pas de clé",
        "Esta edición no tiene clave",
    ),
    "Show": ("Anzeigen", "Afficher", "Mostrar"),
    "Skins": ("Häute", "Peaux", "Pieles"),
    "Overlays": ("Überlagerungen", "Surimpressions", "Sobreimpresos"),
    "Bake": ("Backen", "Précalculer", "Capturar"),
    "Rig": ("Rig", "Rig", "Rig"),
    "On Top Of": ("Auf", "Par-dessus", "Encima de"),
    "Mesh Cache": ("Netz-Cache", "Cache de maillage", "Caché de malla"),
    "Shape Keys": ("Formschlüssel", "Clés de forme", "Formas clave"),
    "Native Rig": ("Natives Rig", "Rig natif", "Rig nativo"),
    "Method": ("Methode", "Méthode", "Método"),
    "Linear": ("Linear", "Linéaire", "Lineal"),
    "Dual Quaternion": ("Duale Quaternionen", "Quaternions duaux", "Cuaterniones duales"),
    "Centers of Rotation": ("Drehzentren", "Centres de rotation", "Centros de rotación"),
    "Influence": ("Einfluss", "Influence", "Influencia"),
    "16-Bit Weights": ("16-Bit-Gewichte", "Poids 16 bits", "Influencias de 16 bits"),
    "Mask": ("Maske", "Masque", "Máscara"),
    "Weights": ("Gewichte", "Poids", "Influencias"),
    "Opacity": ("Deckkraft", "Opacité", "Opacidad"),
    "Joint Weights": ("Gelenkgewichte", "Poids d'articulation", "Influencias de articulación"),
    "Refit Joints": ("Angepasste Gelenke", "Articulations réajustées", "Articulaciones reajustadas"),
    "In Front": ("Im Vordergrund", "Devant", "Delante"),
    "Anchors": ("Anker", "Ancres", "Anclajes"),
    "Fading Cages": ("Verblassende Käfige", "Cages en fondu", "Jaulas que se desvanecen"),
    "Radius": ("Radius", "Rayon", "Radio"),
    "Placement": ("Platzierung", "Placement", "Colocación"),
    "Corners": ("Ecken", "Coins", "Esquinas"),
    "Clearance": ("Abstand", "Dégagement", "Holgura"),
    "Tightness": ("Straffheit", "Ajustement", "Ajuste"),
    "Leave Out": ("Auslassen", "Omettre", "Omitir"),
    "Like": ("Wie", "Comme", "Como"),
    "Cage Repaired Hull": (
        "Reparierte Hülle umschließen",
        "Entourer l'enveloppe réparée",
        "Rodear envolvente reparada",
    ),
    "Elsewhere": ("Anderswo", "Ailleurs", "En otros lugares"),
}
BUTTONS: dict[str, tuple[str, str, str]] = {
    "Bind Cage Rig": ("Käfig-Rig binden", "Lier la cage", "Vincular jaula"),
    "Generate Cage": ("Käfig erzeugen", "Générer une cage", "Generar jaula"),
    "Fit Cage": ("Käfig anpassen", "Ajuster la cage", "Ajustar jaula"),
    "Edit Generated Cage": ("Erzeugten Käfig bearbeiten", "Modifier la cage générée", "Editar jaula generada"),
    "Generate": ("Erzeugen", "Générer", "Generar"),
    "Key Cage": ("Käfig-Schlüssel", "Insérer une clé de cage", "Clave de jaula"),
    "Key Envelope": ("Hüllen-Schlüssel", "Clé d'enveloppe", "Clave de envolvente"),
    "Delete Key": ("Schlüssel löschen", "Supprimer la clé", "Eliminar clave"),
    "Discard": ("Verwerfen", "Abandonner", "Descartar"),
    "Apply Refit": ("Anpassung anwenden", "Appliquer le réajustement", "Aplicar reajuste"),
    "Rebind": ("Neu binden", "Relier", "Volver a vincular"),
    "Unbind": ("Lösen", "Délier", "Desvincular"),
    "Load": ("Laden", "Charger", "Cargar"),
    "Export": ("Exportieren", "Exporter", "Exportar"),
    "Mesh Cache": ("Netz-Cache", "Cache de maillage", "Caché de malla"),
    "Shape Keys": ("Formschlüssel", "Clés de forme", "Formas clave"),
    "Native Rig": ("Natives Rig", "Rig natif", "Rig nativo"),
    "Cage Rig Sample": ("Cage-Rig-Beispiel", "Exemple Cage Rig", "Ejemplo de Cage Rig"),
}


def table() -> dict[str, dict[tuple[str, str], str]]:
    """By language, what Blender looks up: a context and the English words."""
    return {
        language: {
            **{("*", english): words[k] for english, words in LABELS.items()},
            **{("Operator", english): words[k] for english, words in BUTTONS.items()},
        }
        for k, language in enumerate(LANGUAGES)
    }


def register() -> None:
    bpy.app.translations.register(__package__, table())


def unregister() -> None:
    bpy.app.translations.unregister(__package__)
