/* For every source of a package (.cmake/package.cmake): functions that glibc has given a newer version
 * since 2.28 are taken in their former one, whose results are the same. */
#if defined(__x86_64__)
__asm__(".symver exp, exp@GLIBC_2.2.5");
#elif defined(__aarch64__)
__asm__(".symver exp, exp@GLIBC_2.17");
#endif
