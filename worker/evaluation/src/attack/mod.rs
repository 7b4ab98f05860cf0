//! Real attacks on 8-bit pictures: codecs, resampling, noise; never the stand-ins that training uses.
