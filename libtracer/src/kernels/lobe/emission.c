/* Emission of surfaces, and of the world: light without a lobe. */
#include "kernels/lobe/lobe.h"

_Static_assert(TRC_AT(EMISSION, color) == TRC_AT(BACKGROUND, color) &&
                   TRC_AT(EMISSION, strength) == TRC_AT(BACKGROUND, strength),
               "a background is an emission");

static bool emission_of(const struct trc_setup *c, const struct trc_leaf *leaf, vfloat weight,
                        vvec3 *emission) {
    *emission = v3_scale(colour(c, leaf, TRC_AT(EMISSION, color)),
                         number(c, leaf, TRC_AT(EMISSION, strength)) * weight);
    return true;
}

const struct trc_closure TRC_CLOSURE_OF(EMISSION) = {.emission = emission_of};
const struct trc_closure TRC_CLOSURE_OF(BACKGROUND) = {.emission = emission_of};
