#include "gestures.h"

#include <string.h>

/* Depths stay below 10 % of a liver's size, where linear elasticity holds; speeds are those of a trained hand. */
static const struct {
    const char *name, *text;
} gestures[] = {
    {"press", "# press the organ, wait, let go\n"
              "approach 0.3 s\n"
              "press 20 mm in 0.5 s\n"
              "hold 0.3 s\n"
              "press 0 mm in 0.5 s\n"
              "retract 0.3 s\n"},
    {"slide", "# press, then stroke the surface there and back\n"
              "approach 0.3 s\n"
              "press 10 mm in 0.3 s\n"
              "slide 20 mm 0 mm in 0.6 s\n"
              "slide -20 mm 15 mm in 0.6 s\n"
              "slide 0 mm -15 mm in 0.4 s\n"
              "press 0 mm in 0.3 s\n"
              "retract 0.3 s\n"},
    {"poke", "# quick pokes\n"
             "approach 0.3 s\n"
             "poke 10 mm in 0.1 s times 5\n"
             "retract 0.3 s\n"},
    {"hold", "# lean on the organ and stay: noise and drift show here\n"
             "approach 0.3 s\n"
             "press 10 mm in 0.4 s\n"
             "hold 3 s\n"
             "retract 0.5 s\n"},
    {"grasp", "# take hold of the tissue, pull it up and sideways, let go\n"
              "approach 0.3 s\n"
              "press 8 mm in 0.4 s\n"
              "close 0.2 s\n"
              "press -12 mm in 0.8 s\n"
              "hold 0.3 s\n"
              "slide 12 mm 0 mm in 0.5 s\n"
              "hold 0.3 s\n"
              "open 0.1 s\n"
              "hold 0.2 s\n"
              "retract 0.3 s\n"},
    {"two_tools", "# lean on the organ; press it while the other one waits; wait while that one presses\n"
                  "approach 0.3 s\n"
                  "press 8 mm in 0.4 s\n"
                  "hold 0.4 s\n"
                  "press 18 mm in 0.5 s\n"
                  "hold 0.6 s\n"
                  "press 8 mm in 0.5 s\n"
                  "hold 2.0 s\n"
                  "retract 0.4 s\n"},
    {"two_tools-second", "# what the second instrument does beside two_tools\n"
                         "approach 0.3 s\n"
                         "press 8 mm in 0.4 s\n"
                         "hold 2.0 s\n"
                         "press 18 mm in 0.5 s\n"
                         "hold 0.6 s\n"
                         "press 8 mm in 0.5 s\n"
                         "hold 0.4 s\n"
                         "retract 0.4 s\n"},
    {"shape", "# lay a shaft that comes in flat on the organ, close its jaws and open them, stroke, lift off\n"
              "approach 0.3 s\n"
              "press 40 mm in 0.6 s\n"
              "slide 0 mm -8 mm in 0.4 s\n"
              "close 0.4 s\n"
              "open 0.4 s\n"
              "slide 15 mm 0 mm in 0.6 s\n"
              "slide -30 mm 0 mm in 0.9 s\n"
              "slide 15 mm 8 mm in 0.6 s\n"
              "retract 0.5 s\n"},
    {"tour", "# a bit of everything\n"
             "approach 0.3 s\n"
             "press 20 mm in 0.5 s\n"
             "hold 0.3 s\n"
             "press 8 mm in 0.4 s\n"
             "slide 20 mm 10 mm in 0.8 s\n"
             "slide -40 mm 0 mm in 1.2 s\n"
             "slide 20 mm -10 mm in 0.8 s\n"
             "poke 20 mm in 0.3 s times 3\n"
             "press -10 mm in 0.4 s\n"
             "poke 10 mm in 0.12 s times 4\n"
             "retract 0.5 s\n"},
};
enum { GESTURES = sizeof gestures / sizeof gestures[0] };

const char *gesture_builtin(const char *name)
{
    for (size_t i = 0; i < GESTURES; i++)
        if (!strcmp(gestures[i].name, name))
            return gestures[i].text;
    return NULL;
}

const char *gesture_builtin_name(size_t index)
{
    return index < GESTURES ? gestures[index].name : NULL;
}
