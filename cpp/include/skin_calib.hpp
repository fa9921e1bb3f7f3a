// The runtime of skin-calib in C++17: readings of a tactile skin in; contacts, wrench, CoP, ZMP and polygons out.
//
// It needs the standard library alone. `update` allocates no memory, takes no locks and throws nothing. Names, formulas
// and results are those of the Python runtime.
#pragma once

#include "skin_calib/body.hpp"
