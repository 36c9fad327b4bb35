"""The stages that make a run: environment -> expert -> demonstrations -> reward -> agent -> how good it is.

Open first: `pipeline`, all of it in one call; `loop`, the order of the stages and what they need; `stages` and `final_stages`,
what each does. `world_choice` finds where it takes place, `worlds` and `table_world` are those places; `learning_curve` watches
the agent train, `figures` and `filming` make pictures.
"""
