/* The public header compiles alone, in every language that it promises. */
#include "reynolds/reynolds.h"
int main(void) { return (int)sizeof(rey_render_def) == 0; }
